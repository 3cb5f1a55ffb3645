"""Files appear completely or not at all, and nothing that is no file is replaced by
one."""

import os
import resource
import subprocess
import sys
from pathlib import Path

import pytest

from hydroid.errors import RunError
from hydroid.files import read_file, write_atomic
from hydroid.progress import LOGGER
from hydroid.run.process import run_log


def test_a_pipe_a_device_and_a_folder_stay_what_they_are(tmp_path: Path):
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "folder").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "pipe")
    before = {path.name: path.lstat() for path in tmp_path.iterdir()}
    for name in ("pipe", "folder", "link"):
        with pytest.raises(RunError, match=f"{name}: cannot be written .it is no file"):
            write_atomic(tmp_path / name, "text")
    assert {path.name: path.lstat() for path in tmp_path.iterdir()} == before
    with pytest.raises(OSError, match="it is no file"):
        read_file(tmp_path / "pipe")


def test_a_link_stays_and_what_it_leads_to_is_written(tmp_path: Path):
    (tmp_path / "there").mkdir()
    for name in ("old", "new"):
        (tmp_path / name).symlink_to(tmp_path / "there" / name)
    (tmp_path / "there" / "old").write_text("old")
    for name in ("old", "new"):
        write_atomic(tmp_path / name, name * 2)
        assert (tmp_path / name).is_symlink()
        assert (tmp_path / "there" / name).read_text() == name * 2
    assert sorted(path.name for path in tmp_path.rglob("*")) == [
        "new",
        "new",
        "old",
        "old",
        "there",
    ]


def test_a_log_on_a_full_disk_falls_silent(tmp_path: Path):
    limit = resource.getrlimit(resource.RLIMIT_FSIZE)
    with run_log(tmp_path / "run.log"):
        resource.setrlimit(resource.RLIMIT_FSIZE, (0, limit[1]))
        try:
            LOGGER.warning("lost")
            for handler in LOGGER.handlers:
                handler.close()  # writes what is left
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, limit)
    assert (tmp_path / "run.log").read_text() == ""


def test_a_notice_that_is_ignored_from_the_start_stays_ignored():
    """As `nohup` has it; otherwise a closed terminal stops a run as a cluster's notice
    does."""
    code = "import signal; signal.signal(signal.SIGHUP, signal.SIG_{}); "
    code += "from hydroid.commands import progress; "
    code += (
        "progress.listen(); print(signal.getsignal(signal.SIGHUP) is signal.SIG_IGN)"
    )
    for before, says in (("IGN", "True\n"), ("DFL", "False\n")):
        done = subprocess.run(
            [sys.executable, "-c", code.format(before)], capture_output=True, text=True
        )
        assert done.stdout == says


def cli(*words: str, code: str = "") -> str:
    """The command that runs hydroid after some code, in a process of its own."""
    return f"{code}; import sys; sys.argv[1:] = {words!r}; from hydroid.__main__ import main; main()"


def test_a_stop_while_hydroid_is_imported_is_one_line():
    code = cli("check", "a.csv", code="import builtins; old = builtins.__import__")
    stop = """
def new(name, *rest):
    if name == "typer":
        raise KeyboardInterrupt
    return old(name, *rest)
builtins.__import__ = new
"""
    first, rest = code.split("; import sys", 1)
    done = subprocess.run(
        [sys.executable, "-c", f"{first}\n{stop}\nimport sys{rest}"],
        capture_output=True,
        text=True,
    )
    assert (done.returncode, done.stderr) == (
        130,
        "hydroid: stopped; nothing was written\n",
    )


def test_a_stop_of_which_a_library_makes_another_error_is_one_line(tmp_path: Path):
    """As MuJoCo's, NumPy's and others' initialisation does."""
    (tmp_path / "a.csv").write_text("time_s,u2_pct,q2_deg\n0,0,0\n")
    (tmp_path / "mujoco.py").write_text(
        "import os, signal\n"
        "try:\n"
        "    os.kill(os.getpid(), signal.SIGINT)\n"
        "except KeyboardInterrupt as stop:\n"
        "    raise ImportError('initialization failed') from stop\n"
    )
    # in the background the tests ignore SIGINT, and so would the command
    code = "import hydroid, signal; signal.signal(signal.SIGINT, signal.default_int_handler)"
    done = subprocess.run(
        [sys.executable, "-c", cli("check", "a.csv", code=code)],
        capture_output=True,
        text=True,
        cwd=tmp_path,
    )
    assert (done.returncode, done.stderr) == (130, "hydroid: stopped\n")
