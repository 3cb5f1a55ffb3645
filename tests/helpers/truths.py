"""What made a log, beside what a fit found in it: directions and speeds of the joints."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace

import numpy as np
from printed import Followed

from hydroid.run.record import Record, load_record

Speed = Callable[[float], float]
"""speed of a joint [deg/s, mm/s] that a command [%] of the log settles at"""
CLOSE_SPEED = 0.1
"""of the speed at full command of the same direction, up to which a speed is found"""
WEAKEST = 60.0
"""command from which speeds are compared [%]: the logs drive beyond it"""


def judged(found: Followed, speeds: Mapping[str, Speed]) -> Followed:
    """Return what became of printed commands, beside what made the logs, by joint."""
    if found.run is None:
        return found
    record = load_record(found.run)
    wrong = dict[str, str]()
    for joint, speed in speeds.items():
        fault = next(_faults(record, joint, speed), None)
        if fault is not None:
            wrong[joint] = fault
    return replace(found, wrong=wrong)


def _faults(record: Record, joint: str, speed: Speed) -> Iterator[str]:
    """Yield the speeds of a joint that are not the truth's."""
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
        full = speed(sign * np.copysign(100.0, u))
        true = speed(sign * u)
        if abs(u) >= WEAKEST and not abs(value - true) <= CLOSE_SPEED * abs(full):
            yield f"{value:.3g} instead of {true:.3g} {curve.unit} at {u:.0f} %"
