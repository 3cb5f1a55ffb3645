"""Simple models of a joint: which predicts unseen logs better?

A joint's nine numbers (dead band, exponent, speed and lag of each direction, and a
delay) are fitted to the squares of output errors, as the verdict has them, and then in
three rounds to innovations: the noise and the drift are estimated from what they leave,
and the numbers anew. The table of mean speeds with a delay stands beside them, and the
curves at which a fit begins, fitted with delay and lag to what errors of the angle gain
within 1.5 s (`hydroid.fitting.valve_start`). Rms errors [deg] of the logs that are not
fitted.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from common import EXAMPLES, Clock, options, row, table
from scipy.optimize import least_squares

import hydroid
from hydroid.arrays import Array
from hydroid.fitting.baselines import (
    LOWER,
    NAMES,
    SCALE,
    UPPER,
    Baseline,
    fit_baselines,
)
from hydroid.fitting.validation import HORIZONS, errors_ahead
from hydroid.fitting.valve_start import fitted_valve
from hydroid.log import Log
from hydroid.posterior.course import Course, at_stops, travelled
from hydroid.posterior.error_filter import NUMBERS, SHORTEST
from hydroid.posterior.error_model import (
    LEAST_NOISE,
    ErrorModel,
    Signal,
)
from hydroid.settings.fit import FitSettings

SHOWN = (1.0, 5.0, 10.0)


def error_model(
    logs: Sequence[Log], joint: int, limits: tuple[float, float]
) -> ErrorModel:
    """Return the error model of a joint's angle in logs, whose numbers are still to be
    estimated."""
    courses = list[Course]()
    first = 0
    for log in logs:
        angle = log.angle[:, joint - 1]
        rows = slice(first, first + len(angle))
        first = rows.stop
        readings = max(float(log.start_samples[joint - 1]), 1.0)
        way = travelled(angle, log.period)
        stops = at_stops(angle, limits, log.period)
        used = np.ones(len(angle), dtype=bool)
        courses.append(
            Course(rows, 1.0, log.period, way, angle - angle[0], stops, readings, used)
        )
    numbers = np.zeros((1, len(NUMBERS)))
    numbers[0, 0] = LEAST_NOISE["angle"] ** 2
    numbers[0, -1] = SHORTEST
    of = (0,) * len(logs)
    return ErrorModel(
        (Signal(joint, "angle"),), numbers, tuple(courses), of, np.array([np.nan])
    )


def by_innovations(
    model: Baseline, logs: Sequence[Log], limits: tuple[float, float]
) -> Baseline:
    """Return nine numbers that are refitted to the innovations of what they leave."""
    errors = error_model(logs, model.joint, limits)
    x = np.array([*model.numbers.ravel(), model.delay])

    def made(x: Array) -> Baseline:
        return replace(model, numbers=x[:8].reshape(4, 2), delay=float(x[8]))

    def innovations(x: Array, errors: ErrorModel) -> Array:
        return errors.innovations(made(x).errors(logs)[None])[0]

    for _ in range(3):
        errors = errors.estimated(made(x).errors(logs))
        rows = partial(innovations, errors=errors)
        x = least_squares(rows, x, bounds=(LOWER, UPPER), x_scale=SCALE, max_nfev=15).x
    return made(x)


def show(
    name: str, how: str, model: Baseline, logs: Sequence[Log], clock: Clock
) -> None:
    whole = np.degrees(np.sqrt(np.mean(model.errors(logs) ** 2)))
    ahead = np.concatenate(
        [errors_ahead(log, lambda part: model.errors([part])) for log in logs]
    )
    rms = np.degrees(np.sqrt(np.nanmean(ahead**2, axis=0)))
    cells = [f"{rms[HORIZONS.index(seconds)]:.2f}" for seconds in SHOWN]
    row(name, how, *cells, f"{whole:.2f}", clock)


def compare(
    settings: FitSettings, fitted: Sequence[Log], unseen: Sequence[Log]
) -> None:
    for joint in settings.outputs:
        limits = settings.arm.stops(joint)
        name = settings.arm.joint_names[joint - 1]
        tests = [log for log in unseen if log.driven[joint - 1]]
        clock = Clock()
        models = fit_baselines(fitted, joint, limits)
        show(name, "speeds: a table", models[NAMES[1]], tests, clock)
        show("", "angles: nine numbers", models[NAMES[-1]], tests, clock)
        again = by_innovations(models[NAMES[-1]], fitted, limits)
        show("", "innovations: nine numbers", again, tests, clock)
        clock = Clock()
        valve = fitted_valve(fitted, joint)
        if valve is not None:
            show(
                "",
                "changes of angles: curves",
                valve.baseline(joint, limits),
                tests,
                clock,
            )


if __name__ == "__main__":
    options(__doc__)
    table(
        f"joint | fitted to | {' | '.join(f'{s:g} s' for s in SHOWN)} | whole logs | time, from the start"
    )
    folder = EXAMPLES / "excavator"
    excavator = hydroid.load_settings(folder / "fit.yaml")
    logs = [
        hydroid.read_logs(sorted(folder.glob(f"{kind}_*.csv")), excavator)
        for kind in ("fit", "check")
    ]
    compare(excavator, *logs)
    rig = hydroid.load_settings("fit-hyd")
    first, second = (
        hydroid.read_logs([EXAMPLES / "logs" / f"rig_shoulder_{number}.csv"], rig)
        for number in (1, 2)
    )
    compare(rig, first, second)
    compare(rig, second, first)
