"""Follows what `hydroid init` prints: check, fit and validate, as a user pastes them,
in a folder."""

import contextlib
import hashlib
import io
import json
import math
import shlex
import time
from collections.abc import Generator, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
import typer
import yaml

import hydroid
from hydroid.commands.app import app
from hydroid.errors import HydroidError
from hydroid.joint_verdict import Verdict

STEPS = ("check", "fit-hyd", "validate")
"""that are followed; `suggest` comes after them"""
OTHER = "OTHER.csv"
"""stands in what is printed for a log that the fit has not seen"""
PREDICTED = 1 / 3
"""of what standing still errs by: an unseen error up to this shows that the log was
understood"""


@dataclass(frozen=True)
class Followed:
    """What became of printed commands.

    Attributes:
        refused: a line that ended them; empty if all ran.
        lines: all that was printed.
        errors: unseen error and that of standing still [deg, mm], by joint.
        blamed: joints whose verdict is that the fit fails.
        wrong: how joints move otherwise than what made the logs, by joint.
        run: folder of the fit.
    """

    refused: str
    lines: list[str]
    errors: dict[str, tuple[float, float]]
    blamed: tuple[str, ...] = ()
    wrong: Mapping[str, str] = field(default_factory=dict[str, str])
    run: Path | None = None

    @property
    def verdict(self) -> str:
        """Right, refused, named (the verdict says what is predicted badly), or
        wrong."""
        if self.refused:
            return "refused"
        missed = {*self.wrong}
        for name, (unseen, still) in self.errors.items():
            if not unseen <= PREDICTED * still:
                missed.add(name)
        if not missed and self.errors:
            return "right"
        return "named" if missed and missed <= {*self.blamed} else "wrong"

    @property
    def line(self) -> str:
        """Why it was refused; or what is wrong, and the errors with those of standing
        still in brackets."""
        if self.refused:
            return self.refused
        parts = [f"{name} {fault}" for name, fault in self.wrong.items()]
        for name, (unseen, still) in self.errors.items():
            parts.append(f"{name} {unseen:.2g} ({still:.2g})")
        return ", ".join(parts)


Known = dict[bytes, Followed]
"""what became of fits, by what they were fitted to and tested on"""


def follow(
    folder: Path,
    init: Sequence[str],
    unseen: str,
    budget: str,
    known: Known | None = None,
) -> Followed:
    """Run `hydroid init` in a folder, and then the commands that it prints, validated
    on an unseen log.

    The fit has a budget, as `init` proposes: it ends at its best model so far. It counts
    CPU time, so that a busy machine does not end fits earlier. What is `known` is not
    fitted again, and what is found is added.
    """
    lines, errors, blamed = list[str](), dict[str, tuple[float, float]](), list[str]()
    run, key = folder, b""
    with contextlib.chdir(folder):
        try:
            lines += _run(["init", *init])
            for arguments in [*_printed(lines)]:
                command = [unseen if word == OTHER else word for word in arguments]
                if command[0] == "fit-hyd":
                    run = Path(command[command.index("--out") + 1]).absolute()
                    key = _content(run.parents[1], [command[1], unseen])
                    if known and key in known:
                        return known[key]
                    command += ["--budget", budget, "--quiet"]
                if command[0] == "validate":
                    command.append("--json")
                with _cpu_clock():
                    printed = _run(command)
                if command[0] == "validate":
                    verdict = json.loads(printed[-1])["verdict"]
                    errors = _errors(verdict)
                    blamed = [
                        one["name"] for one in verdict if Verdict(one["verdict"]).fails
                    ]
                else:
                    lines += printed
        except HydroidError as error:
            return Followed(str(error), lines, errors)
    found = Followed("", lines, errors, tuple(blamed), run=run)
    if known is not None:
        known[key] = found
    return found


def _content(project: Path, logs: Sequence[str]) -> bytes:
    """Return a hash of what a fit depends on: logs as they are read, to 0.1 % of a
    command and 0.001 deg, the arm, and all settings but the columns."""
    settings = yaml.safe_load((project / "fit.yaml").read_text())
    del settings["log"]
    digest = hashlib.sha256(json.dumps(settings).encode())
    for file in (project / "arm.xml", project / "arm.yaml"):
        digest.update(file.read_bytes())
    read = hydroid.read_logs([*logs], hydroid.load_settings(project / "fit.yaml"))
    for log in read:
        digest.update(np.rint(log.command / 0.1).tobytes())
        digest.update(np.rint(np.degrees(log.angle) / 0.001).tobytes())
    return digest.digest()


def _printed(lines: Sequence[str]) -> Iterator[list[str]]:
    for line in lines:
        words = shlex.split(line) if line.startswith("  hydroid ") else []
        if words[1:2] and words[1] in STEPS:
            yield words[1:]


@contextlib.contextmanager
def _cpu_clock() -> Generator[None]:
    """Let a budget count the CPU time of this process."""
    with mock.patch("hydroid.commands.progress.time.monotonic", time.process_time):
        yield


def _run(arguments: Sequence[str]) -> list[str]:
    """Return what a command prints. Raises HydroidError: it was refused."""
    out, err = io.StringIO(), io.StringIO()
    status = 0
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            status = app(list(arguments), standalone_mode=False)
        except typer.Exit as end:
            status = end.exit_code
    lines = [*err.getvalue().splitlines(), *out.getvalue().splitlines()]
    if status:
        raise HydroidError(
            lines[0] if lines else f"{arguments[0]} ends with status {status}"
        )
    return lines


def _errors(verdict: Sequence[Mapping[str, Any]]) -> dict[str, tuple[float, float]]:
    found = dict[str, tuple[float, float]]()
    for joint in verdict:
        unit = "mm" if "unseen_mm" in joint else "deg"
        unseen = joint[f"unseen_{unit}"]
        still = joint[f"baselines_{unit}"]["standing still"]
        found[joint["name"]] = math.inf if unseen is None else unseen, still
    return found
