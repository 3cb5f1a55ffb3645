"""Tests of what a fit takes for granted: which way an angle counts, where its 0 is, its scale, its columns.

A wrong sign turns gravity round. A fit hides much of that behind other parameters, but not how the load
changes with the pose. Two fits tell, each of a few steps of least squares with the quasi-static model on a
few logs, as assumed and with the assumption changed. First a joint alone, while the others follow their
logged motion. If the change is better there, all joints together: a change that only makes up for
another error of the model spoils the load of other joints. With n independent samples, and sums of squares S
and S' of residuals and priors, the logs make the change more likely by the factor (S / S')^(n/2).
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from hydroid.arm.model import load_model
from hydroid.findings import Finding
from hydroid.log import Log
from hydroid.parameters import Array
from hydroid.posterior.noise import prior_weight, problem_noise
from hydroid.problem.problem import Problem
from hydroid.search.least_squares import least_squares
from hydroid.settings.fit import FitSettings
from hydroid.settings.search import RefinementSettings

Kind = Literal["sign", "zero", "scale"]
CHANGES: Mapping[Kind, tuple[float, ...]] = {"sign": (-1.0,), "zero": (-20.0, 20.0), "scale": (0.5, 2.0)}
"""of a logged angle: factor on it and on its command, degrees that are added to it, factor on it"""
DOUBTED: Mapping[Kind, str] = {"sign": "sign doubted", "zero": "zero doubted", "scale": "scale doubted"}
"""kinds of findings"""
ENOUGH = 4.0
"""evidence that names a joint: the change is 55 times as likely"""
LOWER = 0.97
"""part of the rms error that the change must leave at most"""
LIKELY = 2.0
"""evidence of a joint alone below which a change is not tried on all joints"""
MOST_TRIED = 2
"""changes that are tried on all joints"""
MOST_LOGS = 4
"""logs that are fitted again, spread over all"""
SHORT = RefinementSettings(iterations=8, gain_tolerance=0.01)
LONG = RefinementSettings(iterations=40, gain_tolerance=1e-3)
TINY = np.finfo(float).tiny
FOLLOWED = 0.2
"""by how much a joint's speed must correlate better with another joint's command than with its own"""


@dataclass(frozen=True)
class Doubt:
    """An assumption about one joint (number, from 1) that the logs contradict.

    change: of the logged angle, as CHANGES has it. rms_deg: of all compared angles as assumed, and with the
    change. evidence: logarithm of how much more likely the logs make the change.
    """

    kind: Kind
    joint: int
    change: float
    rms_deg: tuple[float, float] = (np.inf, np.inf)
    evidence: float = -np.inf

    @property
    def holds(self) -> bool:
        """Whether the logs contradict the assumption clearly."""
        return self.evidence >= ENOUGH and self.rms_deg[1] < LOWER * self.rms_deg[0]


@dataclass(frozen=True, eq=False)
class _Refit:
    """What some logs say of a model with some joints compared.

    weight: of the priors. values: by name, at the best fit so far, with half its sum of squares, `cost`.
    rms_deg: of the angles there. samples: independent ones.
    """

    settings: FitSettings
    logs: Sequence[Log]
    weight: float
    values: Mapping[str, float]
    cost: float = np.inf
    rms_deg: float = np.inf
    samples: float = 0.0

    def evidence(self, other: "_Refit") -> float:
        """Logarithm of how much more likely another model is, for the same logs."""
        return float(0.5 * self.samples * np.log(max(self.cost, TINY) / max(other.cost, TINY)))


def doubts(problem: Problem, theta: Array, kinds: Sequence[Kind] = ("sign",)) -> tuple[Doubt, ...]:
    """Test assumptions about every compared joint at an estimate, shape (P,); what is doubted most first.

    Stage 1, and logs that do not measure how each driven joint moves, cannot tell.
    """
    settings, values = problem.settings, problem.parameters.mapping(theta)
    if settings.stage != "hyd" or not all(log.measured[log.driven].all() for log in problem.logs):
        return ()
    logs = [_coarse(log) for log in problem.logs]
    likely = list[tuple[Doubt, _Refit]]()
    for joint in settings.outputs:
        own = [log.driving(joint) for log in logs if log.driven[joint - 1]]
        if own and settings.acting_on(joint):
            before = _begun(_of_joint(settings, joint, values), own, values)
            for kind in kinds:
                tests = (_tested(before, Doubt(kind, joint, change)) for change in CHANGES[kind])
                best = max(tests, key=lambda test: test[0].evidence)
                likely += [best] if best[0].evidence >= LIKELY else []
    if not likely or len(settings.outputs) == 1:
        return tuple(doubt for doubt, _ in likely if doubt.holds)
    whole = _begun(_quasi_static(settings), logs, values)
    likely = sorted(likely, key=lambda one: -one[0].evidence)[:MOST_TRIED]
    found = [_tested(whole, doubt, alone.values)[0] for doubt, alone in likely]
    return tuple(sorted((one for one in found if one.holds), key=lambda one: -one.evidence))


def _coarse(log: Log) -> Log:
    """Return a log with no more than 20 samples a second, its commands averaged."""
    step = max(round(0.05 / log.period), 1)
    size = len(log.time) // step * step
    command = log.command[:size].reshape(-1, step, log.joints).mean(axis=1)
    kept = {"time": log.time[:size:step], "angle": log.angle[:size:step], "period": step * log.period}
    rest = None if log.rest is None else log.rest // step
    return log if step == 1 else replace(log, **kept, command=command, pressure=None, rest=rest)


def _quasi_static(settings: FitSettings) -> FitSettings:
    return settings.changed({"simulation.model": "quasi-static", "free_start": False})


def _of_joint(settings: FitSettings, joint: int, values: Mapping[str, float]) -> FitSettings:
    """Return the settings of one joint alone, what it shares with others free."""
    others = {n for other in settings.outputs if other != joint for n in settings.acting_on(other)}
    held = {n: settings.parameters[n].changed({"fixed": values[n]}) for n in others}
    priors = {n: p for n, p in settings.priors.items() if others.isdisjoint(p.factors)}
    alone = _quasi_static(settings.with_parameters(held))
    changes = {"outputs": (joint,), "simulation.other_joints": "measured", "priors": priors}
    return alone.changed(changes)


def _begun(settings: FitSettings, logs: Sequence[Log], values: Mapping[str, float]) -> _Refit:
    """Refine a model as it is, on some of the logs."""
    chosen = logs[:: -(-len(logs) // MOST_LOGS)]
    problem = Problem(settings, chosen)
    row = problem.residuals(problem.parameters.started(values)[None])[0]
    weight = prior_weight(problem, row)
    return _refined(_Refit(settings, chosen, weight, values), problem)


def _refined(begun: _Refit, problem: Problem, how: RefinementSettings = SHORT) -> _Refit:
    """Refine from its values, and from those before any fit: a wrong sign leads far from the right ones.

    With several joints only the masses are as before any fit.
    """
    parameters, values = problem.parameters, begun.values
    first = parameters.mapping(parameters.start)
    if len(problem.settings.outputs) > 1:
        first = {n: v for n, v in first.items() if problem.settings.parameters[n].link is not None}

    def rows(unit: Array) -> Array:
        theta = parameters.from_unit(unit)
        return np.hstack([problem.residuals(theta), begun.weight * problem.priors.scores(theta)])

    starts = (parameters.to_unit(parameters.started(one)) for one in (values, {**values, **first}))
    end = min((least_squares(start, rows, how) for start in starts), key=lambda end: end.cost)
    if not end.cost < begun.cost:
        return begun
    error = end.residual[: problem.measured.size]
    return replace(
        begun,
        values={**values, **parameters.mapping(parameters.from_unit(end.point))},
        cost=end.cost,
        rms_deg=float(np.degrees(problem.rms(error[None])[0])),
        samples=sum(one.effective_sample_size for one in problem_noise(problem, error)),
    )


def _tested(before: _Refit, doubt: Doubt, start: Mapping[str, float] | None = None) -> tuple[Doubt, _Refit]:
    """Test one assumption, from values that have it changed or that are to be changed.

    A change that helps must still do so where the fit without it goes on from it.
    """
    kind, change = doubt.kind, doubt.change
    after = _changed(before, doubt, start or _moved_alike(before, before.values, doubt, change))
    if before.evidence(after) >= ENOUGH:
        back = replace(before, values=_moved_alike(before, after.values, doubt, 1 / change))
        before = _refined(back, Problem(before.settings, before.logs), LONG)
        after = _changed(before, doubt, after.values, LONG)
    rms = (before.rms_deg, after.rms_deg)
    return Doubt(kind, doubt.joint, change, rms, before.evidence(after)), after


def _changed(
    before: _Refit, doubt: Doubt, values: Mapping[str, float], how: RefinementSettings = SHORT
) -> _Refit:
    """Refine with an assumption about a joint changed, from some values; the joint's stops move with it."""
    arm, spec, kind = before.settings.arm, load_model(before.settings.arm), doubt.kind
    own = np.arange(len(arm.joints)) == doubt.joint - 1
    factor, shift = (1.0, np.radians(doubt.change)) if kind == "zero" else (doubt.change, 0.0)
    factors, signs = np.where(own, factor, 1.0), np.where(own & (kind == "sign"), -1.0, 1.0)
    logs = [
        replace(log, angle=factors * log.angle + shift * own, command=signs * log.command)
        for log in before.logs
    ]
    joint = spec.joint(arm.joint_names[doubt.joint - 1])
    joint.range = np.sort(factor * np.array(joint.range) + shift)
    weights = before.settings.objective.weights
    weights = weights | {doubt.joint: weights.get(doubt.joint, 1.0) / abs(factor)}
    settings = before.settings.changed({"objective.weights": weights})
    return _refined(replace(before, values=values, cost=np.inf), Problem(settings, logs, spec=spec), how)


def _moved_alike(
    before: _Refit, values: Mapping[str, float], doubt: Doubt, factor: float
) -> dict[str, float]:
    """Return values that move a changed joint as before: sides exchanged, or openings for other speeds."""
    after = dict(values)
    own = {p.quantity: n for n, p in before.settings.parameters.items() if p.joints == (doubt.joint,)}
    for quantity, name in own.items():
        other = own.get(f"{quantity[:-1]}b") if quantity.endswith("_a") else None
        if doubt.kind == "sign" and other and not quantity.startswith("area"):
            after[name], after[other] = values[other], values[name]
        elif doubt.kind == "sign" and quantity == "lever_slope":
            after[name] = -values[name]
        elif doubt.kind == "scale" and quantity in ("opening", "opening_a", "opening_b"):
            after[name] = factor * values[name]
    return after


def exchanged(logs: Sequence[Log]) -> tuple[tuple[int, int], ...]:
    """Return pairs of joints (numbers, from 1) each of which follows the other's command, not its own."""
    joints = np.flatnonzero(np.all([log.driven & log.measured for log in logs], axis=0)).tolist()
    follows = {(j, k): _follows(logs, j, k) for j in joints for k in joints} if len(joints) > 1 else {}

    def prefers(j: int, k: int) -> bool:
        return follows[j, k] > follows[j, j] + FOLLOWED

    pairs = ((j, k) for j in joints for k in joints if j < k and prefers(j, k) and prefers(k, j))
    return tuple((j + 1, k + 1) for j, k in pairs)


def _follows(logs: Sequence[Log], joint: int, other: int) -> float:
    """Largest correlation over all logs of a joint's speed with a joint's command up to 0.8 s earlier."""
    coarse = [_coarse(log) for log in logs]
    best, longest = 0.0, round(0.8 / coarse[0].period)
    for late in range(min(longest, min(len(log.time) for log in coarse) - 3) + 1):
        command = [log.command[: len(log.time) - late - 1, other] for log in coarse]
        speed = [np.diff(log.angle[late:, joint]) for log in coarse]
        best = max(best, abs(np.corrcoef(np.concatenate(command), np.concatenate(speed))[0, 1]))
    return float(best)


def assumption_findings(problem: Problem, doubted: Sequence[Doubt]) -> Iterator[Finding]:
    """Yield what the logs contradict, by the joints' names."""
    names = problem.settings.arm.joint_names
    for j, k in exchanged(problem.logs):
        yield Finding("columns exchanged", "warning", (names[j - 1], names[k - 1]))
    for doubt in doubted:
        before, after = doubt.rms_deg
        numbers = {"before": before, "after": after, "change": doubt.change}
        yield Finding(DOUBTED[doubt.kind], "warning", (names[doubt.joint - 1],), numbers)
