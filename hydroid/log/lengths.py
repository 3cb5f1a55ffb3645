"""A recording with lengths of cylinders -> one with angles of their joints."""

from dataclasses import replace

import numpy as np

from hydroid.log.log import LogFinding
from hydroid.log.table import Recording


def as_angles(recording: Recording, findings: list[LogFinding]) -> Recording:
    """Return a recording with the angles of joints in place of the lengths of their
    cylinders.

    Lengths that the cylinder cannot have are an error.
    """
    if all(signal.rod is None for signal in recording.signals):
        return recording
    values = recording.values.copy()
    for signal, column in zip(recording.signals, values.T, strict=True):
        rod = signal.rod
        if rod is None:
            continue
        shortest, longest = rod.ends
        # holes are NaN, which is not outside
        with np.errstate(invalid="ignore"):
            too_short = column < shortest - rod.margin
            too_long = column > longest + rod.margin
        out = np.flatnonzero(too_short | too_long)
        if len(out):
            numbers = {
                "length": 1e3 * column[out[0]],
                "low": 1e3 * shortest,
                "high": 1e3 * longest,
                "setting": signal.setting,
            }
            findings.append(
                recording.finding(
                    "error", "length outside", out, signal, signal.owner, **numbers
                )
            )
        column[:] = rod.angle(column)
    return replace(recording, values=values)
