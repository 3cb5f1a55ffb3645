"""Faults of the run folder: what was good stays good, and the user is told in a
line."""

import errno
import json
import os
import resource
import shutil
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from conftest import SMALL
from made_logs import TRUTH, stepped
from small_fits import Watcher

from hydroid import fit, load_settings, read_logs
from hydroid.errors import RunError
from hydroid.log import write_log
from hydroid.run.folder import RunFolder
from hydroid.run.process import locked

pytestmark = pytest.mark.usefixtures("no_report")
SETTINGS = load_settings("article-mech", SMALL | {"refinement": None})


@pytest.fixture(scope="module")
def path(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("log") / "log.csv"
    write_log(path, stepped(SETTINGS, TRUTH, [60.0, -80.0]), SETTINGS.log)
    return path


@pytest.fixture
def folder(path, tmp_path) -> RunFolder:
    """A run that has begun, with two checkpoints of one and of two generations."""
    folder = RunFolder(tmp_path / "run")
    folder.begin(SETTINGS, read_logs([path], SETTINGS))
    assert "holds no checkpoint yet" in folder.interrupt()
    for number in (1, 2):
        folder.checkpoints()["search"] = stored(number)
    return folder


def stored(number: int) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(number)
    return {"theta": rng.random((20, 9)), "values": rng.random((20, 3))}


def same(folder: RunFolder, number: int) -> bool:
    found, arrays = folder.checkpoints()["search"], stored(number)
    return found.keys() == arrays.keys() and all(
        np.array_equal(found[n], arrays[n]) for n in arrays
    )


@contextmanager
def files_up_to(size: int):
    """A real fault of the operating system's: no file may grow beyond `size` bytes."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def content(folder: Path) -> dict[str, bytes]:
    return {
        p.relative_to(folder).as_posix(): p.read_bytes()
        for p in folder.rglob("*")
        if p.is_file()
    }


def test_flipped_bits_never_change_a_checkpoint(folder):
    """Wherever a bit flips: the newest to its last bit, where the zip does not care, or
    the one before it."""
    file, previous = (
        folder.path / "checkpoint.npz",
        folder.path / "checkpoint.previous.npz",
    )
    whole, before = file.read_bytes(), previous.read_bytes()
    rng = np.random.default_rng(0)
    fallen = 0
    for place in rng.integers(0, len(whole), 300):
        damaged = bytearray(whole)
        damaged[place] ^= 1 << int(rng.integers(8))
        file.write_bytes(damaged)
        newest = same(folder, 2)
        fallen += not file.exists()
        assert newest == file.exists()
        assert newest or same(folder, 1)
        assert previous.read_bytes() == before
    assert fallen > 200


@pytest.mark.parametrize("share", [0, 0.01, 0.5, 0.999])
def test_a_truncated_checkpoint_gives_way_to_the_one_before_it(
    folder, path, share, caplog
):
    file = folder.path / "checkpoint.npz"
    whole = file.read_bytes()
    file.write_bytes(whole[: int(share * len(whole))])
    assert same(folder, 1)
    assert "damaged" in caplog.text
    assert "before it" in caplog.text
    assert (folder.path / "checkpoint.damaged.npz").exists()
    # the damaged one must not take the good one's place
    folder.checkpoints()["search"] = stored(3)
    assert same(folder, 3)
    # as a crash between the two renamings leaves it
    (folder.path / "checkpoint.npz").unlink()
    assert same(folder, 1)


def test_where_none_is_whole_the_run_says_so(folder):
    for name in ("checkpoint.npz", "checkpoint.previous.npz"):
        (folder.path / name).write_bytes(b"PK")
    with pytest.raises(RunError, match=r"is damaged .* remove the run's checkpoints"):
        folder.checkpoints()
    # left for whoever can mend it
    assert (folder.path / "checkpoint.npz").read_bytes() == b"PK"


def test_the_checkpoint_of_another_run_is_refused(folder, path, tmp_path):
    other = RunFolder(tmp_path / "other")
    other.begin(SETTINGS.changed({"search.seed": 2}), read_logs([path], SETTINGS))
    shutil.copy(folder.path / "checkpoint.npz", other.path)
    with pytest.raises(RunError, match="another run's"):
        other.checkpoints()


def test_a_full_disk_leaves_both_checkpoints(folder, monkeypatch):
    """A full disk behind a network is told as late as at the last call."""

    def fsync(handle: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "fsync", fsync)
    before = content(folder.path)
    with pytest.raises(RunError, match="No space left"):
        folder.checkpoints()["search"] = stored(3)
    assert content(folder.path) == before
    assert same(folder, 2)


def test_a_full_disk_ends_a_fit_with_a_line_and_it_goes_on_afterwards(path, tmp_path):
    fit(SETTINGS, path, tmp_path / "whole", progress=Watcher())
    with pytest.raises(KeyboardInterrupt):
        fit(SETTINGS, path, tmp_path / "run", progress=Watcher(stop_at=2))
    with files_up_to(4000), pytest.raises(RunError, match="cannot be written"):
        fit(SETTINGS, path, tmp_path / "run", resume=True, progress=Watcher())
    assert "search" in RunFolder(tmp_path / "run").checkpoints()
    fit(
        load_settings(tmp_path / "run" / "config.yaml"),
        path,
        tmp_path / "run",
        resume=True,
    )
    for name in ("checkpoint.npz", "estimate.yaml", "model/fitted.xml"):
        assert (tmp_path / "run" / name).read_bytes() == (
            tmp_path / "whole" / name
        ).read_bytes()


def test_a_folder_of_something_else_stays_as_it_is(path, tmp_path):
    (tmp_path / "thesis.tex").write_text("mine")
    for resume in (False, True):
        with pytest.raises(RunError, match="holds no run"):
            fit(SETTINGS, path, tmp_path, resume=resume, progress=Watcher())
    assert content(tmp_path) == {"thesis.tex": b"mine"}


def test_a_run_killed_while_it_began_begins_again(path, tmp_path):
    folder = RunFolder(tmp_path)
    with locked(tmp_path):
        folder.begin(SETTINGS, read_logs([path], SETTINGS))
    (tmp_path / "run.json").unlink()
    (tmp_path / ".config.yaml.abc.part").write_text("half")
    fit(SETTINGS, path, tmp_path, resume=True, progress=Watcher())
    assert folder.identity()["status"] == "done"
    assert not list(tmp_path.rglob(".*.part"))


@pytest.mark.parametrize("name", ["config.yaml", "arm.yaml", "model/arm.xml"])
def test_a_run_whose_own_files_were_edited_is_refused_by_name(folder, path, name):
    folder.begin(SETTINGS, read_logs([path], SETTINGS))
    file = folder.path / name
    file.write_text(file.read_text() + "\n")
    with pytest.raises(RunError, match=f"{name}: has changed since the run began"):
        folder.begin(SETTINGS, read_logs([path], SETTINGS))


def test_a_run_of_another_arm_or_model_is_refused(folder, path, tmp_path):
    arm = SETTINGS.arm

    def other(**changes):
        return SETTINGS.changed({"arm": arm.changed(changes)}), read_logs(
            [path], SETTINGS
        )

    with pytest.raises(RunError, match=r"has arm\.actuators.* = "):
        folder.begin(*other(actuators={}))
    model = tmp_path / "model.xml"
    text = arm.model.read_text().replace('meshdir="', f'meshdir="{arm.model.parent}/')
    model.write_text(text)
    with pytest.raises(RunError, match="another model"):
        folder.begin(*other(model=model))


@pytest.mark.parametrize("name", ["hydroid", "mujoco", "numpy", "numba"])
def test_a_run_of_other_versions_is_refused_and_an_old_one_goes_on(folder, path, name):
    logs = read_logs([path], SETTINGS)
    file = folder.path / "run.json"
    described = folder.identity()
    file.write_text(json.dumps(described | {name: "0.0"}))
    with pytest.raises(RunError, match=rf"was made by {name} 0\.0, not \d"):
        folder.begin(SETTINGS, logs)
    # runs of earlier versions do not say theirs of numba
    del described[name]
    for checkpoint in folder.path.glob("checkpoint*"):
        checkpoint.unlink()  # of the whole description
    file.write_text(json.dumps(described))
    folder.begin(SETTINGS, logs)


def test_a_log_that_has_moved_is_the_same_log_and_another_is_named(
    folder, path, tmp_path
):
    moved = tmp_path / "moved.csv"
    moved.write_bytes(path.read_bytes())
    folder.begin(SETTINGS, read_logs(moved, SETTINGS))
    with pytest.raises(
        RunError, match=r"other logs, .*log.csv, not .*moved.csv, .*log.csv"
    ):
        folder.begin(SETTINGS, read_logs([moved, path], SETTINGS))
    moved.write_text("\n".join(path.read_text().splitlines()[:-1]) + "\n")
    with pytest.raises(
        RunError, match=r"other logs, or others' contents: .*log.csv, not .*moved.csv"
    ):
        folder.begin(SETTINGS, read_logs(moved, SETTINGS))


def test_two_in_one_folder_the_second_is_refused(path, tmp_path):
    with (
        locked(tmp_path / "run"),
        pytest.raises(RunError, match=f"in use by process {os.getpid()} on "),
    ):
        fit(SETTINGS, path, tmp_path / "run", progress=Watcher())
    fit(SETTINGS, path, tmp_path / "run", progress=Watcher())
