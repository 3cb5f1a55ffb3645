"""Where least squares begins: a joint's valve at what its logs show, or at the opposite
of what an estimate has, and a shared pump on open centres."""

from collections.abc import Callable, Mapping

import numpy as np

from hydroid.arrays import Array
from hydroid.fitting.baselines import NAMES, Baseline, fit_baselines
from hydroid.fitting.valve_start import fitted_valve
from hydroid.posterior.bench import make_bench
from hydroid.posterior.error_model import make_likelihood
from hydroid.problem.problem import Problem
from hydroid.quantity_table import CURVE

HALF = 0.5
"""part of the lag that is before the dead band, and of the load that is compensated,
where a start knows neither"""
LESS = 0.1
"""part by which errors must fall for a model, or a start, to be refined"""
FULL = {"opening_a": 100.0, "opening_b": -100.0}
"""the command that opens a side of a valve fully [%]"""
OPEN_CENTRE = {"pump_exponent": 5.0, "pump_bypass": 1.5}
"""of a pump that nearly holds its pressure, and whose oil runs through the valves' open
centres where no joint takes it"""


def by_numbers(problem: Problem, joint: int, theta: Array, found: Baseline) -> Array:
    """Return theta, (P,), with the valve of a joint whose speed follows the command
    alone: nine numbers, as they were found."""
    values = {"delay": found.delay, "pilot_lag": 0.0, "lag_of_speed": 1.0}
    rows = {"dead_band": 0, "opening_exponent": 1, "opening_lag": 3}
    for name, row in rows.items():
        values |= _sided(name, *found.numbers[row].tolist())
    for name in CURVE:
        values |= _sided(name, 1.0, 1.0)
    return _with_valve(problem, joint, theta, values, np.abs(found.numbers[2]))


def by_speeds(problem: Problem, joint: int, theta: Array) -> Array:
    """Return theta, (P,), with the valve of a joint at the speeds that its logs show
    (`speed_curve`).

    Unlike nine numbers, it says neither that no load slows the joint, nor that its
    lags are all behind the dead band: least squares seldom leaves either again. It is
    theta itself where its valve has no curve, or the logs show none.
    """
    found = fitted_valve(problem.logs, joint) if has_curve(problem, joint) else None
    if found is None:
        return theta
    a, b = found.sides
    lag = HALF * found.lag
    values = {"delay": found.delay, "pilot_lag": lag, "opening_lag": lag}
    values["compensation"] = HALF
    values |= _sided("dead_band", a.dead_band, b.dead_band)
    values |= _sided("opening_exponent", a.exponent, b.exponent)
    for part, name in enumerate(CURVE):
        values |= _sided(name, a.factors[part], b.factors[part])
    return _with_valve(problem, joint, theta, values, np.array([a.speed, b.speed]))


def with_other_valve(problem: Problem, joint: int, theta: Array) -> Array:
    """Return theta, (P,), with a joint whose valve does the opposite of what it does
    there.

    A load slows it where it did not, or does not where it did. Nothing else is slowed:
    the lever is the same everywhere, and there is no friction.
    """
    start = theta.copy()
    for i, one in enumerate(problem.settings.parameters.values()):
        if one.fixed is not None or one.joints != (joint,):
            continue
        if one.quantity == "compensation":
            start[i] = 0.0 if theta[i] > HALF else 1.0
        elif one.quantity in ("lever_slope", "lever_bend", "damping", "friction"):
            start[i] = 0.0
        elif one.quantity.startswith("area"):
            start[i] = problem.parameters.start[i]
    return np.clip(start, problem.parameters.lower, problem.parameters.upper)


def valve_alone(
    problem: Problem, joint: int, last: Problem, theta: Array
) -> tuple[Array, Array]:
    """Return where a joint may begin whose speed now follows its command alone, (P,)
    each: with the valve that it has at theta of the last problem, at the same full
    speeds; and with that of its logs."""
    kept = problem.parameters.started(last.parameters.mapping(theta))
    full_speed = _full_speed(last, joint)
    speeds = np.array([full_speed(theta, full) for full in FULL.values()])
    own = [*problem.settings.acting_on(joint)]
    of_joint = np.isin(problem.parameters.names, own)
    anew = np.where(of_joint, problem.parameters.start, kept)
    shown = by_speeds(problem, joint, anew)
    # without a curve, or where logs show none, nine numbers do
    if shown is anew:
        ends = problem.settings.arm.stops(joint)
        simple = fit_baselines(problem.logs, joint, ends)
        if NAMES[-1] in simple:
            shown = by_numbers(problem, joint, anew, simple[NAMES[-1]])
    return _with_valve(problem, joint, kept, {}, speeds), shown


def has_curve(problem: Problem, joint: int) -> bool:
    """Return whether a joint's valve has a curve that is estimated, besides its power
    law."""
    parameters = problem.settings.parameters
    own = (parameters[name].quantity for name in problem.settings.acting_on(joint))
    return any(quantity.startswith(CURVE) for quantity in own)


def new_curves(problem: Problem, last: Problem) -> list[int]:
    """Return the joints, from 1, whose valves have a curve here and had none in the
    last model.

    None of a model whose joints have inertia: without that and the oil, the speeds are
    no better start.
    """
    if not problem.settings.rung.at_once:
        return []
    return [
        joint
        for joint in problem.settings.outputs
        if has_curve(problem, joint) and not has_curve(last, joint)
    ]


def _sided(name: str, a: float, b: float) -> dict[str, float]:
    """Return values of a quantity by name: of both sides, and their mean for both."""
    return {name: (a + b) / 2, f"{name}_a": a, f"{name}_b": b}


def _with_valve(
    problem: Problem,
    joint: int,
    theta: Array,
    values: Mapping[str, float],
    speeds: Array,
) -> Array:
    """Return theta, (P,), with quantities of a joint by name, and openings for its full
    speeds [rad/s], (2,).

    No load slows it, its actuator is strong enough for any, and its lever is the same
    everywhere.
    """
    settings = problem.settings
    straight = {"lever_slope": 0.0, "lever_bend": 0.0, "compensation": 1.0}
    start, places = theta.copy(), dict[str, int]()
    for i, one in enumerate(settings.parameters.values()):
        if one.fixed is None and one.joints == (joint,):
            prior, places[one.quantity] = problem.parameters.parameters[i].prior, i
            start[i] = {**straight, **values}.get(one.quantity, start[i])
            if one.quantity.startswith("area") and prior is not None:
                # a weaker one may stall, where nothing has an effect
                start[i] = prior.value(1.0)
    full_speed = _full_speed(problem, joint)
    for side, (name, full) in enumerate(FULL.items()):
        speed = full_speed(start, full)
        if name in places and speed > 0:  # in proportion, where no load slows it
            start[places[name]] *= speeds[side] / speed
    return np.clip(start, problem.parameters.lower, problem.parameters.upper)


def _full_speed(problem: Problem, joint: int) -> Callable[[Array, float], float]:
    """Return what gives the speed of a joint [rad/s] at theta, (P,), under a full
    command [%]."""
    bench = make_bench(problem.settings, problem.logs, joint)

    def full_speed(theta: Array, command: float) -> float:
        candidates = problem.bindings.candidates(theta[None])
        return bench.movement(command).speeds(candidates).max() / bench.unit[0]

    return full_speed


def with_open_centre(problem: Problem, last: Problem, theta: Array) -> Array | None:
    """Return theta, (P,), with a shared pump on open centres, where the last model has
    no such numbers of a pump; else None.

    From a pump whose pressure falls with the flow least squares seldom gets there; the
    way back it finds. Where joints have inertia, that is left out: it takes long.
    """
    if not problem.settings.rung.at_once:
        return None
    before = last.settings.parameters
    places = dict[str, int]()
    for i, (name, one) in enumerate(problem.settings.parameters.items()):
        if name not in before and one.fixed is None:
            places[one.quantity] = i
    if not OPEN_CENTRE.keys() <= places.keys():
        return None
    start = theta.copy()
    for quantity, value in OPEN_CENTRE.items():
        start[places[quantity]] = value
    return np.clip(start, problem.parameters.lower, problem.parameters.upper)


def likelier(problem: Problem, theta: Array, other: Array) -> Array:
    """Return another parameter set, (P,), where it makes the errors of all joints
    together so much likelier than theta that it is worth a refinement; else theta."""
    likelihood = make_likelihood(problem)
    cost = likelihood.negative_log_at(theta)
    of_other = likelihood.negative_log_at(other)
    samples = problem.measured.size / len(problem.settings.outputs)
    return other if of_other < cost - LESS * samples else theta


def share_pump(problem: Problem, theta: Array) -> bool:
    """Return whether joints share a pump at theta, (P,): what those that follow their
    logs take from it is then not known well enough to fit one alone."""
    pump_flow = problem.bindings.candidates(theta[None]).joints.pump_flow
    return bool(np.isfinite(pump_flow).any())
