"""Directions that experience or the equations make suspect, and what they leave determined."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from hydroid.hydraulics.solenoid import curve_exists, force_curve
from hydroid.parameters import Array
from hydroid.problem.problem import Problem
from hydroid.settings.fit import MECHANICAL_UNITS
from hydroid.uncertainty.covariance import KNOWN, Uncertainty

COIL = ("force_1", "force_2", "stroke_1", "stroke_2")
CURRENTS = ("current_max", "current_min")
RATED = "rated_current"
STEP = 1e-5


@dataclass(frozen=True, eq=False)
class Pattern:
    """Directions to be tried: in words, and as relative changes of the p free parameters, shape (m, p)."""

    name: str
    changes: Array


def patterns(problem: Problem, found: Uncertainty) -> Iterator[Pattern]:
    """Yield what is worth a try, the simplest first."""
    names = [n for n, free in zip(problem.parameters.names, found.free, strict=True) if free]
    yield from _alone(problem, found, names)
    yield from _solenoids(problem, found, names)
    yield from _common_scale(problem, found, names)


def _alone(problem: Problem, found: Uncertainty, names: Sequence[str]) -> Iterator[Pattern]:
    """Parameters without effect, and those whose own effect drowns in the noise."""
    where = outputs(problem)
    idle = found.jacobian.without_effect[found.free]
    for name, none, direction in zip(names, idle, np.eye(len(names)), strict=True):
        if none:
            yield Pattern(f"{name} has no effect on {where}", direction[None])
    for name, none, direction in zip(names, idle, np.eye(len(names)), strict=True):
        if not none and np.linalg.norm(found.root @ direction) < 1 / KNOWN:
            yield Pattern(f"{name} by itself", direction[None])


def _common_scale(problem: Problem, found: Uncertainty, names: Sequence[str]) -> Iterator[Pattern]:
    """The equation of motion (1) is linear in these: one factor on all of them cancels.

    What is fixed (the jaws' mass) does not scale along: the free masses then differ from the common factor by
    what makes up for it best.
    """
    settings, idle = problem.settings.parameters, found.jacobian.without_effect[found.free]
    linear = np.array([settings[name].quantity in MECHANICAL_UNITS for name in names]) & ~idle
    mass = np.array([settings[name].quantity == "mass" for name in names]) & linear
    if linear.sum() < 2:
        return
    changes = linear.astype(float)
    if mass.any():
        # least squares with a penalty: a change of 100 % from the common factor counts as much as the noise
        felt = np.vstack([found.root[:, mass], np.eye(mass.sum())])
        target = np.append(-found.root @ changes, np.zeros(mass.sum()))
        changes[mass] += np.linalg.lstsq(felt, target)[0]
    group = [n for n, one in zip(names, linear & ~mass, strict=True) if one]
    masses = [n for n, one in zip(names, mass, strict=True) if one]
    unequal = " (these to make up for what is fixed, unequally)" if np.ptp(changes[linear]) > 0.1 else ""
    yield Pattern(f"{listed([*group, *masses])} scale together{unequal}", changes[None])


def _solenoids(problem: Problem, found: Uncertainty, names: Sequence[str]) -> Iterator[Pattern]:
    """F1, F2, x1, x2 act through δ and k i0² alone; these and the currents through δ and k i²."""
    if problem.settings.stage != "hyd":
        return
    settings = problem.settings.parameters
    values = dict(zip(problem.parameters.names, found.theta, strict=True))
    for joints in {tuple(p.joints or ()) for p in settings.values() if p.quantity in COIL}:
        mine = {p.quantity: n for n, p in settings.items() if tuple(p.joints or ()) == joints}
        nominal = problem.settings.hydraulics.model_dump()
        at = {q: float(values[mine[q]] if q in mine else nominal[q]) for q in (*COIL, *CURRENTS, RATED)}
        if not curve_exists(*(at[q] for q in COIL)):
            continue
        gap, pull, highest, lowest = _acting(at)
        coil = [q for q in COIL if mine.get(q) in names]
        free = coil + [q for q in CURRENTS if mine.get(q) in names]
        if len(trade := _null(at, coil, [0, 1])):
            said = f"act through two combinations only: δ = {gap:.3g} mm and k·i0² = {pull:.3g} N·mm²"
            yield Pattern(f"{listed([mine[q] for q in coil])} {said}", _spread(trade, coil, mine, names))
        if len(free) > len(coil) and len(trade := _null(at, free, [0, 2, 3])):
            known = f"δ = {gap:.3g} mm, k·I_max² = {highest:.3g} and k·I_min² = {lowest:.3g} N·mm²"
            who = " and ".join(mine[q] for q in free[len(coil) :])
            said = (
                f"a common scale of {who} trades with {listed([mine[q] for q in coil])}, at the same {known}"
            )
            yield Pattern(said, _spread(trade, free, mine, names))


def _acting(at: Mapping[str, float]) -> tuple[float, float, float, float]:
    """δ [mm], k i0², k I_max², k I_min² [N·mm²]: all through which coil and currents act."""
    k, gap = force_curve(at["force_1"], at["force_2"], at["stroke_1"], at["stroke_2"], at[RATED])
    currents = (RATED, *CURRENTS)
    return (float(gap), *(float(k) * at[q] ** 2 for q in currents))  # pyright: ignore[reportReturnType]


def _null(at: Mapping[str, float], free: Sequence[str], held: Sequence[int]) -> Array:
    """Relative changes of `free` that leave the numbers `held` of what acts as they are, (m, len(free))."""
    if not free:
        return np.empty((0, 0))
    columns = []
    for quantity in free:
        high, low = (
            np.log(_acting({**at, quantity: at[quantity] * (1 + step)}))[held] for step in (STEP, -STEP)
        )
        columns.append((high - low) / (2 * STEP))
    matrix = np.array(columns).T
    _, values, directions = np.linalg.svd(matrix)
    rank = int(np.sum(values > 1e-6 * values[0]))
    return directions[rank:]


def _spread(
    changes: Array, quantities: Sequence[str], mine: Mapping[str, str], names: Sequence[str]
) -> Array:
    """Return changes of some quantities, shape (m, k), as changes of all free parameters, shape (m, p)."""
    out = np.zeros((len(changes), len(names)))
    out[:, [names.index(mine[q]) for q in quantities]] = changes
    return out


def outputs(problem: Problem) -> str:
    """What is compared, in words."""
    joints = [str(joint) for joint in dict.fromkeys(c.joint for c in problem.channels)]
    which = (
        f"the angle of joint {joints[0]}" if len(joints) == 1 else f"the angles of joints {listed(joints)}"
    )
    pressed = any(c.quantity != "angle" for c in problem.channels)
    return f"{which} and the pressures" if pressed else which


def listed(names: Sequence[str]) -> str:
    """Return names as a sentence lists them."""
    *first, last = names
    return f"{', '.join(first)} and {last}" if first else last
