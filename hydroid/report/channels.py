"""One output of one log as a reader meets it: its name, its joint, what was commanded and measured."""

import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from itertools import count
from pathlib import Path

from hydroid.log import Log
from hydroid.parameters import Array
from hydroid.problem.problem import Problem

_LONGEST_NAME = 40


@dataclass(frozen=True, eq=False)
class Channel:
    """The record of one joint.

    Attributes:
        log: name of the log.
        joint: number of the joint, from 1.
        time: [s], shape (T,).
        command: of this joint [%], shape (T,).
        measured: [rad], shape (T,).
        segments: number of each segment, from 1, and its samples [first, end).
        index: which log and which output of the problem it is.
    """

    log: str
    joint: int
    time: Array
    command: Array
    measured: Array
    segments: tuple[tuple[int, int, int], ...] = ()
    index: tuple[int, int] = (0, 0)

    def simulated(self, responses: Sequence[Array]) -> Array:
        """Return this channel of an estimate's responses [rad], shape (T,)."""
        log, output = self.index
        return responses[log][:, output]


def channels(problem: Problem) -> tuple[Channel, ...]:
    """Return the channels of a fit, in the order of `problem.measured`."""
    names = log_names([log.source for log in problem.logs])
    found: list[Channel] = []
    start = 0
    for i, (log, name) in enumerate(zip(problem.logs, names, strict=True)):
        for k, joint in enumerate(problem.outputs):
            end = start + len(log.time)
            segments = tuple(
                (number, int(a) - start, int(b) - start)
                for number, (a, b) in enumerate(problem.bounds, start=1)
                if start <= a < end
            )
            time, command, measured = log.time, log.command[:, joint], log.angle[:, joint]
            found.append(Channel(name, joint + 1, time, command, measured, segments, (i, k)))
            start = end
    return tuple(found)


def channel(log: Log, joint: int, name: str = "") -> Channel:
    """Return one joint, numbered from 1, of a log that no fit knows."""
    name = name or log_names([log.source])[0]
    return Channel(name, joint, log.time, log.command[:, joint - 1], log.angle[:, joint - 1])


def log_names(sources: Sequence[str]) -> list[str]:
    """Short names of log files, all different, fit to be printed whatever the files are called."""
    names: list[str] = []
    for source in sources:
        names.append(unique(short_name(Path(source).name or source), names))
    return names


def unique(name: str, taken: Collection[str]) -> str:
    """Return the name, numbered where it is taken."""
    candidates = (f"{name} ({n})" if n > 1 else name for n in count(1))
    return next(candidate for candidate in candidates if candidate not in taken)


def file_name(text: str, taken: Collection[str]) -> str:
    """Return text of letters, digits, dot, dash and underscore, numbered where its lower case is taken."""
    safe = re.sub(r"[^A-Za-z0-9._-]+", "_", text)
    candidates = (f"{safe}_{n}" if n > 1 else safe for n in count(1))
    return next(candidate for candidate in candidates if candidate.lower() not in taken)


def short_name(name: str) -> str:
    """Return a name without letters that cannot be printed, its middle left out where it is long."""
    text = "".join(c if c.isprintable() else "?" for c in name)
    half = _LONGEST_NAME // 2
    return text if len(text) <= _LONGEST_NAME else f"{text[: half - 1]}…{text[-half:]}"
