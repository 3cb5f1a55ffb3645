"""Tables for other programs: settled speeds for a PLC, draws of the parameters, and
their ranges."""

import math

import numpy as np

from hydroid.arrays import Array
from hydroid.files import csv_text
from hydroid.plant import Plant
from hydroid.use.draws import Draws, error_numbers

COMMANDS = np.concatenate([np.arange(-100.0, 0.0, 5.0), np.arange(0.0, 101.0, 5.0)])
"""of a table of speeds [%]"""
PARTS = (0.1, 0.3, 0.5, 0.7, 0.9)
"""of a joint's range, at which a table has its speeds"""
ERRORS_HEADER = (
    "joint",
    "unit",
    "sensor",
    "drift_per_root_s",
    "drift_per_root_way",
    "lasting",
    "lasting_s",
)
"""of the table of errors: standard deviations in the unit, after 1 s and after a way of
1 unit of those that grow"""

FAR = 100
"""standard deviations beyond which a machine is as good as impossible"""
RANGES_NOTE = """\
draws.csv   machines that the logs do not rule out, one per row: all parameters together
ranges.csv  the estimate of each parameter, and the range of its draws (95 %)
errors.csv  what the machine does besides, as standard deviations in the unit of the row:
            sensor              the sensor's noise, of each sample
            drift_per_root_s    a random walk of the angle away from the model's: so far after 1 s, twice that
                                after 4 s
            drift_per_root_way  a random walk with the way travelled: so far after a way of 1 unit
            lasting, lasting_s  an error that lasts for a moment, and its time constant

Randomise by the rows of draws.csv. Ranges taken one by one are too wide: parameters that trade with each
other, such as an opening and a pressure, would be drawn apart. By the logs, such machines lie {apart}
standard deviations per parameter from the estimate in the mean; rows of draws.csv lie about 1.
"""


def speed_tables(plant: Plant) -> dict[str, str]:
    """Return a table per joint as CSV, by file name: settled speed against command, at
    places of its range.

    Each joint moves alone; the others stand where the plant does.
    """
    files = dict[str, str]()
    arm = plant.identified.settings.arm
    for column in [joint - 1 for joint in plant.joints]:
        unit = arm.joints[column].shown.unit
        factor = arm.joints[column].shown.factor
        low, high = arm.limits[column]
        header = ["command_pct"]
        columns = [COMMANDS]
        for angle in low + np.array(PARTS) * (high - low):
            header.append(f"{unit}_per_s_at_{factor * angle:.4g}_{unit}")
            angles = np.full(len(COMMANDS), angle)
            columns.append(factor * speeds_alone(plant, column, angles, COMMANDS))
        rows = [header]
        for row in np.column_stack(columns):
            rows.append([f"{cell:.6g}" for cell in row])
        files[f"speeds_{plant.names[column]}.csv"] = csv_text(rows)
    return files


def speeds_alone(plant: Plant, column: int, angles: Array, commands: Array) -> Array:
    """Return the settled speeds [rad/s] of a joint at n angles [rad] and commands [%],
    all of shape (n,).

    The others stand where the plant does, at commands of 0.
    """
    poses = np.tile(plant.angle, (len(angles), 1))
    poses[:, column] = angles
    given = np.zeros_like(poses)
    given[:, column] = commands
    return plant.steady().speeds(given, poses)[:, column]


def parameter_files(draws: Draws) -> dict[str, str]:
    """Return draws, ranges and errors as CSV, by file name, with a text that says what
    to take."""
    parameters = draws.model.settings.parameter_set().parameters
    units = [parameter.unit for parameter in parameters]
    low, high = np.quantile(draws.theta, [0.025, 0.975], axis=0)
    numbers = (draws.model.theta.tolist(), low.tolist(), high.tolist())
    ranges = zip(draws.names, units, *numbers, strict=True)
    header = ("parameter", "unit", "estimate", "lower", "upper")
    return {
        "draws.csv": csv_text([draws.names, *draws.theta.tolist()]),
        "ranges.csv": csv_text([header, *ranges]),
        "errors.csv": csv_text([ERRORS_HEADER, *_error_rows(draws)]),
        "README.txt": RANGES_NOTE.format(apart=_spelt(draws.apart)),
    }


def _error_rows(draws: Draws) -> list[tuple[str | float, ...]]:
    """Return the error of each joint that the fit compared, as `ERRORS_HEADER` has
    it."""
    arm = draws.model.settings.arm
    rows = list[tuple[str | float, ...]]()
    for joint, numbers in zip(arm.joints, error_numbers(draws.model), strict=True):
        sensor, with_time, with_way, lasting, seconds = numbers.tolist()
        if seconds == 0.0:
            continue
        unit = joint.shown.unit
        factor = joint.shown.factor
        # variances grow with time and way, and the way is in the unit too
        own = factor * math.sqrt(sensor), factor * math.sqrt(with_time)
        grown = math.sqrt(factor * with_way)
        lasted = factor * math.sqrt(lasting), seconds
        rows.append((joint.name, unit, *own, grown, *lasted))
    return rows


def _spelt(apart: float) -> str:
    """Return a distance in standard deviations; beyond FAR its size says nothing."""
    return f"more than {FAR}" if apart > FAR else f"{apart:.3g}"
