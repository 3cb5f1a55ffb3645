"""What a joint carries, and what its load does to its speed, at a fit's estimate.

A report computes it from what a run stores: gravity and inertia are of interest even
where the settings give them and no parameter changes them.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from hydroid.arrays import Array, record
from hydroid.estimate import Interval, finite_ends
from hydroid.log import Log
from hydroid.posterior.bench import Bench, Direction, logged_travel, make_bench
from hydroid.posterior.column import Column, Measured
from hydroid.posterior.posterior import Posterior
from hydroid.posterior.quantities import (
    COMMANDS,
    LEAST_STEP,
    Measure,
    directions,
    first_moving,
    known_columns,
)
from hydroid.problem.bindings import Bindings
from hydroid.settings.fit import FitSettings
from hydroid.simulation import Candidates

LOADS = (0.0, 1.0, 2.0)
"""parts of what holds a joint in its pose, under which its speed is stated"""


@record
class Known:
    """A value, its 95 % interval, and whether the settings alone give it."""

    value: float
    interval: Interval
    given: bool


@record
class MovedUnderLoad:
    """A joint that moves in one direction, under a command that is held.

    Attributes:
        word: what it does then, such as `raising`.
        command: [%].
        speeds: under each of LOADS, above 0 in the direction of the command.
        change: of the speed from the load as it is to twice the load [%]; None: the
            joint stands still under it.
    """

    word: str
    command: float
    speeds: tuple[Known, ...]
    change: Known | None


@record
class UnderLoad:
    """What a joint carries in the middle of its logged travel; all other joints are as
    the first log starts.

    Attributes:
        joint: numbered from 1.
        pose: in words.
        gravity: what holds it against gravity [N·m], or of a joint that slides [N].
        over_travel: the least and the largest of it at the ends of the logged travel
            and in the pose.
        inertia: as the joint feels it [kg·m²], or [kg].
        moved: in both directions; empty of stage 1, and of a joint that gravity does
            not load.
        shut: speed with the valve shut, by the leakage of the model alone; None: stage 1.
    """

    joint: int
    pose: str
    gravity: Known
    over_travel: tuple[float, float]
    inertia: Known
    moved: tuple[MovedUnderLoad, ...]
    shut: Known | None


def under_load(
    settings: FitSettings, posterior: Posterior, logs: Sequence[Log], joint: int
) -> UnderLoad:
    """Return what a joint, numbered from 1, carries, and its speeds under load."""
    bench = make_bench(settings, logs, joint)
    estimate = Bindings(settings).candidates(posterior.box.at[None])
    moves = _moves(bench, estimate)
    measure = _measure(bench, moves)
    columns, estimated = known_columns(settings, posterior, joint, measure)
    known = dict[str, Known]()
    for i, column in enumerate(columns):
        if np.isfinite(estimated.value[i]):
            ends = finite_ends(estimated.interval[i])
            given = bool(estimated.given[i])
            known[column.name] = Known(float(estimated.value[i]), ends, given)
    moved = list[MovedUnderLoad]()
    for direction, command in moves:
        names = [_speed_name(direction, part) for part in LOADS]
        # a speed that does not exist is not stated
        speeds = tuple(known[name] for name in names if name in known)
        if len(speeds) < len(LOADS):
            continue
        change = known.get(f"change_{direction.ending}")
        moved.append(MovedUnderLoad(direction.word, abs(command), speeds, change))
    gravity = known["gravity"]
    torques = [gravity.value, *_at_ends(bench, logs, estimate)]
    return UnderLoad(
        joint=joint,
        pose=bench.pose,
        gravity=gravity,
        over_travel=(min(torques), max(torques)),
        inertia=known["inertia"],
        moved=tuple(moved),
        shut=known.get("shut"),
    )


def _moves(bench: Bench, estimate: Candidates) -> list[tuple[Direction, float]]:
    """Return the directions in which a joint is tested under load, and the commands
    [%]: those of its step responses."""
    gravity = float(bench.weigh(estimate)[0][0])
    # below 1 N·m gravity is none
    if bench.settings.stage == "mech" or abs(gravity) < 1.0:
        return []
    loads = bench.loads(estimate)
    moves = list[tuple[Direction, float]]()
    for direction in directions(bench, estimate):
        commands = direction.sign * np.array(COMMANDS)
        speeds = direction.sign * bench.sense * bench.steady(estimate, commands, loads)
        planned = dict(zip(COMMANDS, speeds[0].tolist(), strict=True))
        told = [size for size in COMMANDS if bench.tells(direction.sign * size)]
        size = first_moving(planned, told, LEAST_STEP)
        moves.append((direction, direction.sign * size))
    return moves


def _measure(bench: Bench, moves: Sequence[tuple[Direction, float]]) -> Measure:
    """Return what measures candidates under load."""

    def measure(candidates: Candidates) -> Measured:
        gravity, inertia = bench.weigh(candidates)
        yield Column("gravity", "", "", positive=False), gravity
        yield Column("inertia", "", ""), inertia
        if bench.settings.stage == "mech":
            return
        loads = bench.loads(candidates)
        shut = bench.steady(candidates, np.zeros(1), loads)[:, 0]
        yield Column("shut", "", "", positive=False), shut
        for direction, command in moves:
            yield from _moved(bench, candidates, loads, (direction, command))

    return measure


def _moved(
    bench: Bench, candidates: Candidates, loads: Array, move: tuple[Direction, float]
) -> Measured:
    """Yield the speeds under each of LOADS in one direction, and their change."""
    direction, command = move
    towards = direction.sign * bench.sense
    by_part = dict[float, Array]()
    for part in LOADS:
        steady = bench.steady(candidates, np.array([command]), part * loads)
        by_part[part] = towards * steady[:, 0]
        name = _speed_name(direction, part)
        yield Column(name, "", "", positive=False), by_part[part]
    with np.errstate(all="ignore"):
        change = 100.0 * (by_part[2.0] / by_part[1.0] - 1.0)
    yield Column(f"change_{direction.ending}", "", "%", positive=False), change


def _speed_name(direction: Direction, part: float) -> str:
    return f"speed_{direction.ending}_{part:g}"


def _at_ends(bench: Bench, logs: Sequence[Log], estimate: Candidates) -> list[float]:
    """Return what holds a joint against gravity at both ends of its logged travel."""
    ends = logged_travel(logs, bench.joint)
    return [float(replace(bench, angle=end).weigh(estimate)[0][0]) for end in ends]
