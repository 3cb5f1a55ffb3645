"""Tables for other programs: settled speeds for a PLC, draws of the parameters, and
their ranges."""

import numpy as np

from hydroid.files import csv_text
from hydroid.plant import Plant
from hydroid.use.draws import Draws

COMMANDS = np.concatenate([np.arange(-100.0, 0.0, 5.0), np.arange(0.0, 101.0, 5.0)])
"""of a table of speeds [%]"""
PLACES = (0.1, 0.3, 0.5, 0.7, 0.9)
"""of a joint in its range, at which a table has its speeds"""
ENDLESS = np.pi
"""end of the range of a joint that turns without end [rad]"""

RANGES_NOTE = """\
draws.csv   machines that the logs do not rule out, one per row: all parameters together
ranges.csv  the estimate of each parameter, and the range of its draws (95 %)
errors.csv  what the machine does besides: noise of the sensors, and drift of the angles from the model's
            with time (rate) and with the way travelled (way)

Randomise by the rows of draws.csv. Ranges taken one by one are too wide: parameters that trade with each
other, such as an opening and a pressure, would be drawn apart. By the logs, such machines lie {apart}
standard deviations per parameter from the estimate in the mean; rows of draws.csv lie about 1.
"""


def speed_tables(plant: Plant) -> dict[str, str]:
    """Return a table per joint as CSV, by file name: settled speed against command, at
    places of its range.

    Each joint moves alone; the others stand where the plant does.
    """
    files: dict[str, str] = {}
    arm, start, steady = plant.identified.settings.arm, plant.angle, plant.steady()
    for joint in plant.joints:
        column, name = joint - 1, plant.names[joint - 1]
        slides = arm.joints[column].slides
        factor, unit = (1e3, "mm") if slides else (float(np.degrees(1.0)), "deg")
        low, high = np.clip([arm.lower[column], arm.upper[column]], -ENDLESS, ENDLESS)
        places = low + np.array(PLACES) * (high - low)
        header = [
            "command_pct",
            *(f"{unit}_per_s_at_{factor * place:.4g}_{unit}" for place in places),
        ]
        columns = [COMMANDS]
        for place in places:
            pose, command = (
                np.tile(start, (len(COMMANDS), 1)),
                np.zeros((len(COMMANDS), len(start))),
            )
            pose[:, column], command[:, column] = place, COMMANDS
            columns.append(factor * steady.speeds(command, pose)[:, column])
        rows = [[f"{cell:.6g}" for cell in row] for row in np.column_stack(columns)]
        files[f"speeds_{name}.csv"] = csv_text([header, *rows])
    return files


def parameter_files(draws: Draws) -> dict[str, str]:
    """Return draws, ranges and errors as CSV, by file name, with a text that says what
    to take."""
    settings = draws.model.settings
    units = [settings.parameters[name].unit for name in draws.names]
    low, high = np.quantile(draws.theta, [0.025, 0.975], axis=0)
    ranges = zip(
        draws.names,
        units,
        draws.model.theta.tolist(),
        low.tolist(),
        high.tolist(),
        strict=True,
    )
    keys = ("sensor_deg", "drift_per_s", "drift_per_way", "lasting_deg", "lasting_s")
    errors = [
        [name, *(getattr(one, key) for key in keys)]
        for name, one in draws.errors.items()
    ]
    return {
        "draws.csv": csv_text([draws.names, *draws.theta.tolist()]),
        "ranges.csv": csv_text(
            [("parameter", "unit", "estimate", "lower", "upper"), *ranges]
        ),
        "errors.csv": csv_text([("angle", *keys), *errors]),
        "README.txt": RANGES_NOTE.format(apart=f"{draws.apart:.3g}"),
    }
