"""All quantities of a fit: what its logs determine, in the words of an engineer."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from hydroid.estimate import CurveEstimate, QuantityEstimate, finite
from hydroid.parameters import Array
from hydroid.posterior.bench import Bench, make_bench
from hydroid.posterior.measures import Column, gain_model, gravity, oil, speed_tests
from hydroid.posterior.uncertainty import Uncertainty
from hydroid.problem.problem import Problem
from hydroid.simulation import Candidates


@dataclass(frozen=True)
class Quantities:
    """What follows from an estimate: single quantities and curves by name.

    Quantities that no free parameter changes are left out: the settings give them, not the logs.
    """

    scalars: dict[str, QuantityEstimate]
    curves: dict[str, CurveEstimate]


def quantities(problem: Problem, uncertainty: Uncertainty) -> Quantities:
    """Return the quantities of every compared joint at a fit's estimate."""
    result = Quantities({}, {})
    for joint in problem.settings.outputs:
        _add_joint(result, problem, uncertainty, joint)
    return result


def _add_joint(result: Quantities, problem: Problem, uncertainty: Uncertainty, joint: int) -> None:
    """Add the quantities of one joint, numbered from 1."""
    candidates = problem.bindings.candidates
    estimate = candidates(uncertainty.theta[None])
    measure = joint_measure(make_bench(problem.settings, problem.logs, joint), estimate)
    columns = [column for column, _ in measure(estimate)]

    def values(theta: Array) -> Array:
        return np.stack([value for _, value in measure(candidates(theta))], axis=1)

    parameters = problem.settings.parameters.values()
    concerned = np.array([p.joints is None or joint in p.joints for p in parameters])
    positive = np.array([column.positive for column in columns])
    known = uncertainty.posterior.propagate(values, positive, concerned)
    ends = [(finite(low), finite(high)) for low, high in known.interval]
    parts, named = dict[str, list[int]](), problem.settings.arm.joint_names[joint - 1]
    for i in np.flatnonzero(np.isfinite(known.value)).tolist():
        parts.setdefault(columns[i].name, []).append(i)
    for part, own in parts.items():
        if known.given[own].all():
            continue
        commands, first, name = [columns[i].command for i in own], columns[own[0]], f"{named}_{part}"
        what: dict[str, Any] = {"label": first.label, "joint": joint, "unit": first.unit}
        if first.command is None:
            value, sd = float(known.value[own[0]]), finite(known.sd[own[0]])
            result.scalars[name] = QuantityEstimate(**what, value=value, sd=sd, interval=ends[own[0]])
        else:
            points = sorted(zip(commands, known.value[own].tolist(), (ends[i] for i in own), strict=True))
            what |= dict(zip(("at", "value", "interval"), zip(*points, strict=True), strict=True))
            result.curves[name] = CurveEstimate(**what, along="command [%]")


def joint_measure(bench: Bench, estimate: Candidates) -> Callable[[Candidates], list[tuple[Column, Array]]]:
    """Return what computes the quantities of one joint; test movements are planned at the estimate."""
    if bench.settings.stage == "mech":
        tests = []
    else:
        torque = float(bench.weigh(estimate)[0][0])
        signs = ("positive", "negative")
        words = ("raising", "lowering") if torque * bench.sense > 0 else ("lowering", "raising")
        words = words if abs(torque) >= 1.0 else signs  # below 1 N·m no direction is called raising
        tests = [
            speed_tests(bench, estimate, sign, f"_{ending}", f", {word}")
            for sign, ending, word in zip((1.0, -1.0), signs, words, strict=True)
        ]
    further = oil if tests else gain_model

    def measure(candidates: Candidates) -> list[tuple[Column, Array]]:
        torque, inertia = bench.weigh(candidates)
        moved = [row for test in tests for row in test(candidates)]
        return [*moved, *further(bench, candidates, inertia), gravity(bench, torque)]

    return measure
