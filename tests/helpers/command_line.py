"""The command line in this process: exit status, what it prints, and what it
refuses."""

import sys
from collections.abc import Callable
from typing import NamedTuple

import pytest

from hydroid.commands.app import main


class Ended(NamedTuple):
    code: int
    out: str
    err: str


Run = Callable[..., Ended]


def run(
    arguments: tuple[object, ...], capsys: pytest.CaptureFixture[str], code: int = 0
) -> Ended:
    """Run a command; it must end with this exit status and without a traceback."""
    capsys.readouterr()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", ["hydroid", *map(str, arguments)])
        with pytest.raises(SystemExit) as end:
            main()
    out, err = capsys.readouterr()
    assert end.value.code == code, out + err
    assert "Traceback" not in err
    return Ended(code, out, err)
