"""All quantities of a fit: what its logs determine, in the words of an engineer."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hydroid.estimate import CurveEstimate, QuantityEstimate, finite
from hydroid.parameters import Array
from hydroid.posterior.bench import Bench, make_bench
from hydroid.posterior.column import SIGNS, Column, Measure, Measured
from hydroid.posterior.covariance import Uncertainty
from hydroid.posterior.posterior import Known
from hydroid.posterior.speeds import SpeedTests
from hydroid.posterior.statics import gain_model, gravity, oil
from hydroid.problem.problem import Problem
from hydroid.simulation import Candidates

LEAST_GRAVITY = 1.0
"""holding torque below which no direction is called raising [N·m]"""


@dataclass(frozen=True)
class Quantities:
    """What follows from an estimate: single quantities and curves by name, and what they were computed from.

    Quantities that no free parameter changes are left out: the settings give them, not the logs.
    slopes: relative changes of the single quantities per relative change of the parameters that vary, (p,).
    """

    scalars: dict[str, QuantityEstimate]
    curves: dict[str, CurveEstimate]
    slopes: dict[str, Array]


def quantities(problem: Problem, uncertainty: Uncertainty) -> Quantities:
    """Return the quantities of every compared joint at a fit's estimate."""
    estimate = problem.bindings.candidates(uncertainty.theta[None])
    scalars: dict[str, QuantityEstimate] = {}
    curves: dict[str, CurveEstimate] = {}
    slopes: dict[str, Array] = {}
    for joint in problem.settings.outputs:
        bench = make_bench(problem.settings, problem.logs, joint)
        measure = joint_measure(bench, estimate)
        columns = [column for column, _ in measure(estimate)]

        def values(theta: Array, measure: Measure = measure) -> Array:
            found = measure(problem.bindings.candidates(theta))
            return np.stack([value for _, value in found], axis=1)

        concerned = np.array(
            [p.joints is None or joint in p.joints for p in problem.settings.parameters.values()]
        )
        names = [c.name for c in columns]
        positive = np.array([c.positive for c in columns])
        result = uncertainty.posterior.propagate(values, positive, concerned)
        single = [i for i, c in enumerate(columns) if not c.along]
        scalars |= {names[i]: _scalar(joint, columns[i], result, i) for i in single if _told(result, i)}
        slopes |= {
            names[i]: result.slopes[:, i] / result.value[i]
            for i in single
            if names[i] in scalars and result.value[i] != 0
        }
        for name in dict.fromkeys(c.name for c in columns if c.along):
            points = [i for i, n in enumerate(names) if n == name and np.isfinite(result.value[i])]
            if any(_told(result, i) for i in points):
                curves[name] = _curve(joint, columns, result, sorted(points, key=lambda i: columns[i].at))
    return Quantities(scalars, curves, slopes)


def joint_measure(bench: Bench, estimate: Candidates) -> Measure:
    """Return what computes the quantities of one joint; test movements are planned at the estimate."""
    if bench.settings.stage == "mech":
        return lambda candidates: [*gain_model(bench, candidates), *gravity(bench, candidates)]
    torque = float(bench.weigh(estimate, np.array([bench.angle]))[0][0, 0])
    words = ("raising", "lowering") if torque * bench.sense > 0 else ("lowering", "raising")
    words = words if abs(torque) >= LEAST_GRAVITY else SIGNS
    tests = [
        SpeedTests(bench, estimate, sign, named)
        for sign, named in zip((1.0, -1.0), zip(SIGNS, words, strict=True), strict=True)
    ]

    def measure(candidates: Candidates) -> Measured:
        moved = [pair for test in tests for pair in test.measure(candidates)]
        return [*moved, *oil(bench, candidates), *gravity(bench, candidates)]

    return measure


def _told(result: Known, i: int) -> bool:
    """Whether a quantity exists and depends on a free parameter."""
    return bool(np.isfinite(result.value[i]) and not result.given[i])


def _interval(result: Known, i: int) -> tuple[float | None, float | None]:
    return finite(result.interval[i, 0]), finite(result.interval[i, 1])


def _scalar(joint: int, column: Column, result: Known, i: int) -> QuantityEstimate:
    return QuantityEstimate(
        label=column.label,
        joint=joint,
        value=float(result.value[i]),
        unit=column.unit,
        sd=finite(result.sd[i]),
        interval=_interval(result, i),
    )


def _curve(joint: int, columns: Sequence[Column], result: Known, points: Sequence[int]) -> CurveEstimate:
    first = columns[points[0]]
    return CurveEstimate(
        label=first.label,
        joint=joint,
        unit=first.unit,
        along=first.along,
        at=tuple(columns[i].at for i in points),
        value=tuple(float(result.value[i]) for i in points),
        interval=tuple(_interval(result, i) for i in points),
    )
