"""A disk that is full at any moment of any command: one line says so, what is on the
disk is whole, and a fit goes on once there is room."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from command_line import run
from conftest import SMALL
from disks import PAGE, disk, used
from log_files import head
from taken import without_times

import hydroid

ROOM = 32 * 1024**2
"""size of a disk that is large enough for every command [byte]"""
QUICK = [f"--set={key}={json.dumps(value)}" for key, value in SMALL.items()]
QUICK.append("--set=refinement.iterations=1")
COURSE = (".lock", "run.log", "run.json")
"""files that tell of a run's course, which differs"""
COMMANDS = {
    "convert": "convert a.csv --out disk/a.csv",
    "init": "init disk/mine --log a.csv",
    "init without a model": "init disk/mine --log a.csv --joints turn,boom --lengths 0,2",
    "fit-mech": "fit-mech a.csv --out disk/run --resume",
    "fit-hyd": "fit-hyd a.csv --mech mech --out disk/run --resume",
    "validate": "validate a.csv --fit hyd --out disk/validated",
    "analyse": "analyse --fit mech --out disk/analysed",
    "simulate": "simulate a.csv --fit hyd --out disk/a.csv",
    "follow": "follow path.csv --fit hyd --out disk/a.csv",
    "draws": "export hyd --to parameters --draws 3 --out disk/out",
    "table": "export hyd --to table --out disk/out",
    "mjcf": "export hyd --to mjcf --out disk/out",
    "linear": "export hyd --to linear --at shoulder=40 --out disk/out",
}


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder that holds a log of four seconds, the fits mech and hyd of it, and a
    path of the joint that they move."""
    folder = tmp_path_factory.mktemp("small")
    log = head(folder / "a.csv", 400)
    rows = [line.split(",") for line in log.read_text().splitlines()]
    columns = [rows[0].index(name) for name in ("time_s", "q2_deg")]
    path = [",".join(row[column] for column in columns) for row in rows]
    (folder / "path.csv").write_text("\n".join(path) + "\n")
    settings = SMALL | {"refinement.iterations": 1}
    hydroid.fit_mech(log, set=settings, out=folder / "mech")
    hydroid.fit_hyd(log, mech=folder / "mech", set=settings, out=folder / "hyd")
    return folder


@pytest.fixture
def here(small: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(small)
    return small


def whole(folder: Path) -> dict[str, bytes]:
    """Files by name, besides those that tell of a run's course; pages without the times
    that it took."""
    return {
        file.relative_to(folder).as_posix(): without_times(file.read_bytes())
        for file in folder.rglob("*")
        if file.is_file() and file.name not in COURSE
    }


def full(lines: str) -> bool:
    """Whether exactly one line says that there is no room."""
    return lines.count("No space left on device") == 1 and "Traceback" not in lines


@pytest.mark.slow
@pytest.mark.usefixtures("short_searches")
@pytest.mark.parametrize("words", COMMANDS.values(), ids=COMMANDS)
def test_it_is_said_in_a_line_and_what_is_written_is_whole(
    here: Path, capsys: pytest.CaptureFixture[str], words: str
):
    """With no room at all, with room for all but the last page, and between."""
    command = words.split()
    fits = command[0].startswith("fit-")
    command += QUICK if fits else []
    place = here / "disk"
    with disk(place, ROOM):
        run(command, capsys)
        everything = whole(place)
        pages = used(place) // PAGE
    for room in sorted({0, pages // 2, pages - 1}):
        # no disk is smaller than a page
        with disk(place, (room + 1) * PAGE) as small_disk:
            filler = place / "filler"
            filler.write_bytes(b"0" * PAGE)
            assert full(run(command, capsys, 2).err)
            filler.unlink()
            assert whole(place).items() <= everything.items()
            assert not list(place.rglob(".*.part"))
            if fits:
                small_disk.resize(ROOM)
                run(command, capsys)
                assert whole(place) == everything


@pytest.mark.slow
def test_a_report_that_cannot_be_drawn_anew_stays_as_it_was(
    here: Path, capsys: pytest.CaptureFixture[str]
):
    before = whole(here / "mech")
    with disk(here / "disk", used(here / "mech") + PAGE):
        shutil.copytree("mech", "disk/run")
        assert full(run(["report", "disk/run"], capsys, 2).err)
        assert whole(here / "disk" / "run") == before


@pytest.mark.slow
def test_a_disk_that_nobody_may_write_to(
    here: Path, capsys: pytest.CaptureFixture[str]
):
    for words in COMMANDS.values():
        with disk(here / "disk", ROOM) as protected:
            protected.protect()
            said = run(words.split(), capsys, 2).err.splitlines()
            assert "cannot be written (Read-only file system)" in said[-1]


def ended(*words: str, **options: Any) -> "subprocess.CompletedProcess[str]":
    command = [sys.executable, "-m", "hydroid", *words]
    options = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE} | options
    return subprocess.run(command, text=True, check=False, **options)


@pytest.mark.parametrize("words", ["check a.csv", "check a.csv --json"])
def test_an_output_that_cannot_be_written_is_one_line(tmp_path: Path, words: str):
    head(tmp_path / "a.csv", 100)
    with Path("/dev/full").open("w") as out:
        done = ended(*words.split(), stdout=out, cwd=tmp_path)
    assert done.returncode == 2
    assert "hydroid: the output: cannot be written (No space left" in done.stderr
    assert full(done.stderr)


def test_lines_about_a_fit_that_cannot_be_written_do_not_end_it(tmp_path: Path):
    """As on a cluster, where stderr is a file on the disk of the user's home."""
    head(tmp_path / "a.csv", 400)
    with Path("/dev/full").open("w") as err:
        fit = ended(
            "fit-mech", "a.csv", "--out=run", *QUICK, "-v", stderr=err, cwd=tmp_path
        )
        wrong = ended("check", "nowhere.csv", stderr=err, cwd=tmp_path)
    assert (fit.returncode, wrong.returncode) == (0, 2)
    assert (tmp_path / "run" / "report.html").exists()


@pytest.mark.slow
def test_a_full_disk_of_compiled_functions_is_said(here: Path):
    with disk(here / "disk", PAGE):
        where = os.environ | {"NUMBA_CACHE_DIR": str(here / "disk")}
        done = ended("simulate", "a.csv", "--fit=hyd", "--out=new.csv", "-q", env=where)
    assert (done.returncode, len(done.stderr.splitlines())) == (2, 1)
    assert full(done.stderr)
    assert "NUMBA_CACHE_DIR" in done.stderr
    assert not (here / "new.csv").exists()
