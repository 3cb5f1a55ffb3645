"""What made a log, beside what a fit found in it: directions and speeds of the joints."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace

import numpy as np
from printed import Followed

from hydroid.run.record import FinishedRun, load_record

Speed = Callable[[float], float]
"""speed of a joint [deg/s, mm/s] that a command [%] of the log settles at"""
CLOSE_SPEED = 0.1
"""of the speed at the strongest command of the same direction, up to which a speed is
found"""
WEAKEST = 0.6
"""part of the strongest command from which speeds are compared"""


def judged(
    found: Followed, speeds: Mapping[str, Speed], strongest: float = 100.0
) -> Followed:
    """Return what became of printed commands, beside what made the logs, by joint.

    `strongest`: command of the logs [%]; of speeds beyond it they tell nothing.
    """
    if found.run is None:
        return found
    record = load_record(found.run)
    wrong = dict[str, str]()
    for joint, speed in speeds.items():
        fault = next(_faults(record, joint, speed, strongest), None)
        if fault is not None:
            wrong[joint] = fault
    return replace(found, wrong=wrong)


def _faults(
    record: FinishedRun, joint: str, speed: Speed, strongest: float
) -> Iterator[str]:
    """Yield the speeds of a joint that are not the truth's, of commands up to the
    strongest [%]."""
    settings = record.settings
    number = settings.arm.joint_names.index(joint) + 1
    command = settings.log.columns("command", number)
    angle = settings.log.columns("angle", number)
    if command is None or angle is None:
        yield "has no columns"
        return
    # the settings may count a command, or an angle, the other way than the log
    sign = float(np.sign(command.scale * angle.scale))
    curve = record.summary.curves[f"{joint}_speed"]
    for u, value in zip(curve.at, curve.value, strict=True):
        full = speed(sign * np.copysign(strongest, u))
        true = speed(sign * u)
        is_driven = WEAKEST * strongest <= abs(u) <= strongest
        if is_driven and not abs(value - true) <= CLOSE_SPEED * abs(full):
            yield f"{value:.3g} instead of {true:.3g} {curve.unit} at {u:.0f} %"
