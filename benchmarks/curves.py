"""How well a valve's curve is recovered from simulated logs, and whether its bands hold
the truth.

The shoulder of the shipped arm, by the quasi-static model, is moved with random sticks
for a minute, and its angle gets noise. Dead bands, openings and exponents of both
directions and the delay are free, with the factors of both curves and their smoothness.
A fit starts at the speeds that the log shows, as `init` has it. Truths are power laws,
curves whose bends are drawn from the prior, and valves that open all at once. Counted
are the points of the speed curve at the commands of `hydroid.posterior.quantities`
whose 95 % interval holds the true speed, and the factors of the power laws whose
interval holds 1. `--exponent`: without curves.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from common import Clock, options, row, table
from made_logs import noisy, simulate_log, step_log
from recovery import refined, settings_of

from hydroid.arrays import Array
from hydroid.fitting.starts import by_speeds
from hydroid.log import Log
from hydroid.posterior.quantities import quantities
from hydroid.posterior.uncertainty import uncertainty
from hydroid.problem.problem import Problem
from hydroid.quantity_table import CURVE
from hydroid.settings.expansion import CURVE_SD
from hydroid.settings.fit import FitSettings

JOINT = 2
NOISE_DEG = 0.05
MARGIN = 0.05
"""distance from the stops [rad]"""
PUSHES = [150.0] * 3 + [80.0] * 5 + [30.0] * 12
"""sum of the commands [%] from which they turn back, in the tries for a log that
reaches no stop"""
KINDS = ["power law", "bends", "all at once"]
VALVE = {
    "onset": 0.0,
    "current_min": 0.8,
    "plunger_stiffness": 4.3,
    "slot_width": 0.208,
    "plunger_mass": 0.008,
    "plunger_damping": 14.0,
}
"""what `init` writes of a coil that moves its spool in proportion to the command"""


def made_settings(*, curved: bool) -> FitSettings:
    rows: dict[str, Mapping[str, object]] = {
        "delay": {"quantity": "delay", "bounds": [0, 0.5], "start": 0.05}
    }
    for side in "ab":
        rows[f"dead_{side}"] = {
            "quantity": f"dead_band_{side}",
            "nominal": 20,
            "sd": 15,
            "bounds": [0, 90],
        }
        rows[f"open_{side}"] = {
            "quantity": f"opening_{side}",
            "nominal": 0.1,
            "within": 10,
        }
        rows[f"power_{side}"] = {
            "quantity": f"opening_exponent_{side}",
            "nominal": 1.4,
            "within": 3,
        }
        if curved:
            rows[f"curve_{side}"] = {"quantity": f"curve_{side}"}
    named = {name: dict(entry) | {"joints": [JOINT]} for name, entry in rows.items()}
    return settings_of(named, **VALVE).changed(
        {"simulation.model": "quasi-static", "outputs": [JOINT]}
    )


def drawn(
    kind: str, rng: np.random.Generator, settings: FitSettings
) -> dict[str, float]:
    """Draw the true values of a valve's parameters by name."""
    truth = {"delay": rng.uniform(0.02, 0.2)}
    for side in "ab":
        truth[f"dead_{side}"] = rng.uniform(5, 45)
        truth[f"open_{side}"] = rng.uniform(0.06, 0.12)
        truth[f"power_{side}"] = float(np.exp(rng.uniform(np.log(0.8), np.log(2.4))))
        scatter = (
            0.0 if kind == "power law" else CURVE_SD / np.sqrt(rng.chisquare(2) / 2)
        )
        bends = min(scatter, 3 * CURVE_SD) * rng.normal(size=len(CURVE))
        bends[0] += np.log(40.0) if kind == "all at once" else 0.0
        for part, factor in enumerate(np.exp(np.cumsum(bends[::-1])[::-1]), 1):
            truth[f"curve_{side}_{part}"] = float(factor)
    known = {
        name: one.fixed
        for name, one in settings.parameters.items()
        if one.fixed is not None
    }
    return {
        name: float(truth.get(name, known.get(name) or 0.0))
        for name in settings.parameters
    }


def recorded(
    truth: Mapping[str, float], settings: FitSettings, rng: np.random.Generator
) -> Log:
    """A minute of sticks, a step every 0.4 s, that reaches no stop if it can."""
    pose = settings.arm.pose("study")
    low, high = settings.arm.joints[JOINT - 1].limits
    pose[JOINT - 1] = (low + high) / 2
    log = _driven(PUSHES[0], pose, truth, settings, rng)
    for push in PUSHES[1:]:
        angle = log.angle[:, JOINT - 1]
        if angle.min() > low + MARGIN and angle.max() < high - MARGIN:
            break
        log = _driven(push, pose, truth, settings, rng)
    return noisy(log, NOISE_DEG, rng)


def _driven(
    push: float,
    pose: Array,
    truth: Mapping[str, float],
    settings: FitSettings,
    rng: np.random.Generator,
) -> Log:
    levels, place = list[float](), 0.0
    for size in rng.uniform(5, 100, 150):
        sign = -np.sign(place) if abs(place) > push else rng.choice([-1.0, 1.0])
        place += sign * size
        levels.append(sign * size)
    return simulate_log(settings, step_log(pose, {JOINT: levels}, 0.4), truth)


def compared(
    problem: Problem, theta: Array, truth: Mapping[str, float]
) -> dict[str, Any]:
    """Return which points of the speed curve, and which factors, have intervals that
    hold the truth."""
    known = uncertainty(problem, theta)
    (curve,) = quantities(problem, known)[1].values()
    true = problem.parameters.vector(truth, "truth")
    (exact,) = quantities(problem, uncertainty(problem, true))[1].values()
    limits = np.array(curve.interval, float)
    inside = (limits[:, 0] <= exact.value) & (limits[:, 1] >= exact.value)
    moving = np.abs(exact.value) > 0.5
    full = np.max(np.abs(exact.value))
    errors = np.abs(np.subtract(curve.value, exact.value)) / full
    widths = (limits[:, 1] - limits[:, 0]) / 2 / full
    factors = [
        i
        for i, name in enumerate(problem.parameters.names)
        if name.startswith("curve_")
    ]
    low, high = known.interval[factors].T
    return {
        "inside": inside[moving],
        "error": errors[moving],
        "width": widths[moving],
        "factors": (low <= true[factors]) & (high >= true[factors]),
        "bends": np.abs(np.log(theta[factors])),
    }


def main() -> None:
    args = options(__doc__, fits=10, kinds=KINDS, exponent=False)
    chosen = args.kinds if isinstance(args.kinds, list) else KINDS
    table(
        "truth | fits | speeds inside [%] | error, half width [% of full] | factors inside [%] | time"
    )
    for kind in chosen:
        clock, results = Clock(), list[dict[str, Any]]()
        for number in range(args.fits):
            rng = np.random.default_rng([number, KINDS.index(kind)])
            settings = made_settings(curved=True)
            truth = drawn(kind, rng, settings)
            log = recorded(truth, settings, rng)
            if args.exponent:
                settings = made_settings(curved=False)
            problem = Problem(settings, [log])
            start = by_speeds(problem, JOINT, problem.parameters.start)
            results.append(
                compared(problem, refined(problem, start), truth_of(truth, problem))
            )
        speeds, factors = (
            np.concatenate([one[key] for one in results])
            for key in ("inside", "factors")
        )
        error, width = (
            np.median(np.concatenate([one[key] for one in results]))
            for key in ("error", "width")
        )
        told = f"{100 * factors.mean():.0f}" if factors.size else ""
        row(
            kind,
            len(results),
            f"{100 * speeds.mean():.1f}",
            f"{error:.2%}, {width:.2%}",
            told,
            clock,
        )


def truth_of(truth: Mapping[str, float], problem: Problem) -> dict[str, float]:
    return {name: truth[name] for name in problem.parameters.names}


if __name__ == "__main__":
    main()
