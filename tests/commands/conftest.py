"""What tests of commands share: the command line in this process, in a folder of its own, and a short log."""

from pathlib import Path

import pytest
from command_line import Ended, Run, run

LOG = Path(__file__).parents[2] / "examples" / "logs" / "rig_shoulder_1.csv"


@pytest.fixture(scope="session")
def short(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Ten seconds of a virtual rig's log."""
    path = tmp_path_factory.mktemp("log") / "short.csv"
    path.write_text("\n".join(LOG.read_text().splitlines()[:1001]) + "\n")
    return path


@pytest.fixture
def hydroid_cli(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Run:
    """Runs a command in `tmp_path`: `hydroid_cli("check", log, code=0)`."""
    monkeypatch.chdir(tmp_path)

    def command(*arguments: object, code: int = 0) -> Ended:
        return run(arguments, capsys, code)

    return command
