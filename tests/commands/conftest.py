"""What tests of commands share: the command line in this process, in a folder of its
own, and a short log."""

from pathlib import Path

import pytest
from command_line import Ended, Run, run
from conftest import SMALL
from log_files import head

import hydroid
from hydroid.reporting import page_file


@pytest.fixture(scope="session")
def short(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Ten seconds of a virtual rig's log."""
    return head(tmp_path_factory.mktemp("log") / "short.csv", 1000)


@pytest.fixture(scope="session")
def array(
    tmp_path_factory: pytest.TempPathFactory,
) -> tuple[Path, dict[int, hydroid.FitResult]]:
    """Four seconds of the log, a.csv; beside it three small runs of it, seed-1 to
    seed-3; their results."""
    folder = tmp_path_factory.mktemp("array")
    log = head(folder / "a.csv", 400)
    small = SMALL | {
        "refinement.iterations": 1,
        "design": {"effort": 3, "poses": "any", "clearance_m": None},
    }
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(page_file, "write_page", lambda *_: [])  # figures take longest
        runs = {
            n: hydroid.fit_mech(log, seed=n, set=small, out=folder / f"seed-{n}")
            for n in (1, 2, 3)
        }
    return folder, runs


@pytest.fixture
def hydroid_cli(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Run:
    """Runs a command in `tmp_path`: `hydroid_cli("check", log, code=0)`."""
    monkeypatch.chdir(tmp_path)

    def command(*arguments: object, code: int = 0) -> Ended:
        return run(arguments, capsys, code)

    return command
