"""What one log commanded and measured at one joint, as a reader meets it."""

from collections.abc import Sequence
from dataclasses import dataclass

from hydroid.log import Log
from hydroid.parameters import Array
from hydroid.problem.problem import Problem
from hydroid.report.names import log_names


@dataclass(frozen=True, eq=False)
class JointRecord:
    """The record of one joint.

    Attributes:
        log: name of the log.
        joint: number of the joint, from 1.
        time: [s], shape (T,).
        command: of this joint [%], shape (T,).
        measured: angle [rad], shape (T,).
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
        """Return this joint's part of an estimate's responses [rad], shape (T,)."""
        log, output = self.index
        return responses[log][:, output]


def joint_records(problem: Problem) -> tuple[JointRecord, ...]:
    """Return the records of a fit, in the order of `problem.measured`."""
    names = log_names([log.source for log in problem.logs])
    records: list[JointRecord] = []
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
            records.append(JointRecord(name, joint + 1, time, command, measured, segments, (i, k)))
            start = end
    return tuple(records)


def joint_record(log: Log, joint: int, name: str) -> JointRecord:
    """Return one joint, numbered from 1, of a log that was not fitted."""
    return JointRecord(name, joint, log.time, log.command[:, joint - 1], log.angle[:, joint - 1])
