"""Commands computed from a fit, played on the true machine: how well do joints follow
four paths?

The machines are those of `make bench B=strangers`, which fits them first (`--machines
3`, same `--folder` and `--seed`): equations and integrator are not hydroid's. Each path
lasts 20 s. It is followed

- open loop: by `hydroid follow`, and by the inverses of nine numbers and of a table of
  speeds, which are fitted to the same logs and look ahead by their own delay and lag;
- with a PID controller of the measured angles beside them, and by that controller
  alone. It asks for speeds, which nine numbers turn into commands, dead band included;
  its gains are the best of 18 by the fit's own plant with the noise of the logs, on the
  last path and alone. It smooths errors, and leaves alone what is within the noise.

Errors are rms over all samples and the joints that a path moves.

Machines can be run in parts, by --first, and be printed together with --stored, which
plays nothing again.

--boom RUN: the virtual boom of examples/boom instead (played_boom.py), with the run of
its README: a pump that comes up late, oil trapped and with air, Stribeck friction. It
has one joint, and no path of a tip.
"""

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from common import options, row, table
from played_boom import BoomRun, PlayedBoom
from scipy.optimize import least_squares
from stranger import STEP, Machine

from hydroid.arrays import Array
from hydroid.fitting.baselines import Baseline
from hydroid.identified_model import IdentifiedModel, load_identified
from hydroid.log import Log
from hydroid.plant import Plant
from hydroid.run.record import load_record
from hydroid.use.follow import follow

SECONDS, REST = 20.0, 1.0
FULL = 0.45
"""part of the joints' top speeds that a path reaches"""
REACH = 0.3
"""part of a range that a path keeps to, to either side of its middle"""
GAINS = (0.1, 0.2, 0.3, 0.45, 0.6, 0.8)
"""speed per error, times delay and lag"""
PARTS = ((0.0, 0.0), (0.3, 0.0), (0.3, 0.3))
"""rate of the integral part, by the gain; time of the derivative part, by delay and
lag: P, PI and PID"""
FILTER = 0.2
"""time over which errors are smoothed, by delay and lag"""
UNFELT = 2.0
"""error that a controller leaves alone, in standard deviations of the sensor's noise:
valves should not chatter on it"""
STORE = "feed_forward.json"
"""in a machine's folder: what its paths gave"""
LARGE = 1.0
"""rms error from which on a path counts as one that is not followed [deg]"""
QUIET = 0.01
"""part of a top speed below which a controller asks for nothing: dead bands would
chatter"""
WAYS = ("the fit", "nine numbers", "speed tables", "no feed-forward")
"""of commands; without feed-forward the controller is alone"""


@dataclass(frozen=True)
class Pid:
    """Gains of a controller that asks for speeds: of the error [1/s], of its integral
    [1/s], of its derivative [s]."""

    gain: float
    integral: float
    derivative: float


class Controller:
    """The controller of one play of a case."""

    def __init__(self, pid: Pid, case: "Case") -> None:
        self._pid = pid
        self._period = case.period
        self._top = case.top
        self._unfelt = UNFELT * case.machine.noise
        smoothed = FILTER * float(case.late.max())
        self._taken = case.period / (case.period + smoothed)
        self._smooth = np.zeros_like(case.top)
        self._sum = np.zeros_like(case.top)

    def speed(self, error: Array) -> Array:
        """Return the speeds that are asked for where angles err [rad], both (J,)."""
        pid = self._pid
        step = self._taken * (error - self._smooth)
        self._smooth = self._smooth + step
        felt = self._smooth - self._smooth.clip(-self._unfelt, self._unfelt)
        self._sum = self._sum + pid.integral * felt * self._period
        # no joint makes up for more than its top speed: what is beyond would wind up
        most = self._top / max(pid.gain, 1e-9)
        self._sum = self._sum.clip(-most, most)
        change = np.where(felt == 0.0, 0.0, step / self._period)
        return pid.gain * (felt + self._sum + pid.derivative * change)


@dataclass(frozen=True)
class Case:
    """A machine, its fit, and the simple models of its joints by name."""

    machine: Machine | PlayedBoom
    model: IdentifiedModel
    simple: dict[str, list[Baseline]]

    @property
    def period(self) -> float:
        """Of the logs [s]."""
        return self.model.settings.log.period_s

    @cached_property
    def top(self) -> Array:
        """Speed of each joint that the logs show in both directions [rad/s], (J,)."""
        tables = [one.table for one in self.simple["speed tables"]]
        return np.array(
            [min(np.max(t[:, 1]), -np.min(t[:, 1])) for t in tables if t is not None]
        )

    @cached_property
    def late(self) -> Array:
        """Delay and lag of each joint, by nine numbers [s], (J,)."""
        return np.array(
            [one.delay + one.numbers[3].mean() for one in self.simple["nine numbers"]]
        )

    @cached_property
    def valves(self) -> Array:
        """Dead band [%], exponent and full speed [rad/s] of both directions of each
        joint, by nine numbers, (3, J, 2)."""
        numbers = [one.numbers[:3] for one in self.simple["nine numbers"]]
        return np.array(numbers).swapaxes(0, 1)


class StrangerRun:
    """One run of a machine of `stranger`, at rest at angles [rad], (J,), in steps of a
    period [s]."""

    def __init__(
        self, machine: Machine, start: Array, period: float, samples: int
    ) -> None:
        self._machine = machine
        self._carry = machine.at_rest(start)
        self._count = round(period / STEP)
        self._given = np.zeros((samples * self._count, machine.joints))
        self._first = 0

    @property
    def angle(self) -> Array:
        """[rad], shape (J,)."""
        return self._carry[0].copy()

    def hold(self, command: Array) -> None:
        """Hold commands [%], (J,), for a period."""
        first = self._first
        self._first += self._count
        self._given[first : self._first] = command
        self._machine.go_on(self._given[: self._first], self._carry, first)


def begun(case: Case, wished: Log) -> StrangerRun | BoomRun:
    """The true machine at rest where a path begins."""
    start = wished.angle[0]
    samples = len(wished.time)
    if isinstance(case.machine, PlayedBoom):
        return case.machine.play(start, case.period, samples)
    return StrangerRun(case.machine, start, case.period, samples)


def smooth(time: Array, begin: float, seconds: float) -> Array:
    """From 0 to 1 between two times."""
    part = np.clip((time - begin) / seconds, 0.0, 1.0)
    return part**3 * (10.0 - 15.0 * part + 6.0 * part**2)


def there_and_back(time: Array, begin: float, seconds: float) -> Array:
    return smooth(time, begin, 0.45 * seconds) - smooth(
        time, begin + 0.55 * seconds, 0.45 * seconds
    )


def ramps(time: Array, case: Case) -> Array:
    """Each joint in turn, out and back."""
    each = (SECONDS - REST) / case.machine.joints
    return np.column_stack(
        [
            there_and_back(time, REST + j * each, each)
            for j in range(case.machine.joints)
        ]
    )


def digging(time: Array, case: Case) -> Array:
    """One joint after the other, overlapping, and back in the same order."""
    begins = np.linspace(REST, 6.0, case.machine.joints)
    return np.column_stack([there_and_back(time, begin, 12.0) for begin in begins])


def together(time: Array, case: Case) -> Array:
    """Sines of different periods, all at once."""
    grown = smooth(time, REST, 3.0)
    periods = np.linspace(4.0, 9.0, case.machine.joints)
    return np.column_stack(
        [grown * np.sin(2 * np.pi * (time - REST) / one) for one in periods]
    )


def tip(time: Array, case: Case) -> Array:
    """The end of boom and arm goes up and down a line, as a sine; other joints rest."""
    machine = case.machine
    assert isinstance(machine, Machine)
    pair = [machine.names.index("boom"), machine.names.index("arm")]
    middle, length = machine.ends.mean(axis=1)[pair], machine.length[pair]

    def place(angle: Array) -> Array:
        pitch = np.cumsum(angle)
        return np.array([length @ np.cos(pitch), length @ np.sin(pitch)])

    height = smooth(time, REST, 3.0) * np.sin(2 * np.pi * (time - REST) / 6.0)
    angles, last = np.zeros((len(time), machine.joints)), middle
    for k, one in enumerate(height):
        wished = place(middle) + 0.15 * length.sum() * np.array([0.0, one])
        last = least_squares(lambda angle, to=wished: place(angle) - to, last).x
        angles[k, pair] = last - middle
    return angles


PATHS: dict[str, Callable[[Array, Case], Array]] = {
    "ramps": ramps,
    "tip on a line": tip,
    "digging": digging,
    "all at once": together,
}


def path(case: Case, kind: str) -> Log:
    """A path about the middle of the ranges, as fast as FULL says, or as far as
    REACH."""
    time = np.arange(round(SECONDS / case.period), dtype=float) * case.period
    shape = PATHS[kind](time, case)
    half = REACH * np.ptp(case.machine.ends, axis=1)
    far = np.abs(shape).max(axis=0)
    fast = np.abs(np.gradient(shape, case.period, axis=0)).max(axis=0) / (
        FULL * case.top
    )
    with np.errstate(divide="ignore"):
        scale = np.minimum(np.where(far > 0, half / far, np.inf), 1.0 / fast)
    if kind == "tip on a line":  # both joints together, or it is no line
        scale[:] = scale.min()
    moved = shape * np.where(np.isfinite(scale), scale, 0.0)
    angle = case.machine.ends.mean(axis=1) + moved
    return Log(kind, time, np.zeros_like(angle), angle, case.period)


def inverse(one: Baseline, speed: Array) -> Array:
    """Commands [%] at which a simple model of a joint has speeds [rad/s], (T,); full
    ones where it has not."""
    if one.table is not None:
        commands, speeds = one.table.T
        rising = np.sign(speeds[-1] - speeds[0])
        order = np.maximum.accumulate(rising * speeds)
        return np.interp(
            rising * speed, order + 1e-12 * np.arange(len(order)), commands
        ) * (speed != 0)
    return valve_commands(np.array(one.numbers[:3])[:, None], speed[:, None])[:, 0]


def valve_commands(valves: Array, speed: Array) -> Array:
    """Commands [%] of J joints at speeds [rad/s], both (..., J); `valves` as those of a
    case."""
    full = valves[2, :, 0]
    side = np.where(speed / full > 0, 0, 1)
    dead, exponent, full = valves[:, np.arange(valves.shape[1]), side]
    part = np.clip(np.abs(speed / full), 0.0, 1.0) ** (1.0 / exponent)
    command = (1.0 - 2.0 * side) * (dead + (100.0 - dead) * part)
    return np.where(speed == 0, 0.0, command)


def ahead(wished: Log, late: Array) -> Array:
    """Wished speeds [rad/s], (T, J), earlier by what joints are late [s], (J,)."""
    speed = np.diff(wished.angle, axis=0, append=wished.angle[-1:]) / wished.period
    columns = zip(speed.T, late, strict=True)
    return np.column_stack(
        [
            np.interp(wished.time + lag, wished.time, one, right=0.0)
            for one, lag in columns
        ]
    )


def simple_commands(case: Case, wished: Log, name: str) -> Array:
    """Commands [%], (T, J), by the inverse of simple models."""
    models = case.simple[name]
    late = np.array(
        [
            one.delay + (0.0 if one.table is not None else one.numbers[3].mean())
            for one in models
        ]
    )
    speeds = ahead(wished, late)
    speeds[np.abs(speeds) < 0.005 * case.top] = 0.0
    return np.column_stack(
        [inverse(one, speed) for one, speed in zip(models, speeds.T, strict=True)]
    )


def play(
    case: Case, wished: Log, command: Array, pid: Pid, rng: np.random.Generator
) -> Array:
    """Angles of the true machine [rad], (T, J), under commands [%] and feedback."""
    run = begun(case, wished)
    controller = Controller(pid, case)
    machine = case.machine
    angle = np.empty_like(command)
    forward = ahead(wished, case.late) if command.any() else np.zeros_like(command)
    for k, one in enumerate(command):
        angle[k] = run.angle
        noise = rng.normal(0.0, machine.noise, machine.joints)
        more = controller.speed(wished.angle[k] - angle[k] - noise)
        run.hold(np.clip(one + correction(case, forward[k], more), -100.0, 100.0))
    return angle


def correction(case: Case, forward: Array, more: Array) -> Array:
    """What is added to commands [%] for more speed [rad/s] beside that which they
    already ask for."""
    wished = np.array([forward + more, forward])
    wished[np.abs(wished) < QUIET * case.top] = 0.0
    asked, before = valve_commands(case.valves, wished)
    return asked - before


def tuned(case: Case) -> Pid:
    """The gains with which the controller alone follows the last path best, on the
    fit's own plant."""
    wished, plant = path(case, [*PATHS][-1]), Plant(case.model)
    late = float(case.late.max())
    still = np.zeros(case.machine.joints)
    found = dict[Pid, float]()
    for part, (integral, derivative) in product(GAINS, PARTS):
        pid = Pid(part / late, integral * part / late, derivative * late)
        controller = Controller(pid, case)
        angle, rng = [plant.reset(wished.angle[0])], np.random.default_rng(0)
        for k in range(len(wished.time) - 1):
            read = angle[-1] + rng.normal(0.0, case.machine.noise, case.machine.joints)
            more = correction(case, still, controller.speed(wished.angle[k] - read))
            angle.append(plant.step(np.clip(more, -100.0, 100.0)))
        found[pid] = rms_of(np.array(angle), wished)
    return min(found, key=lambda pid: found[pid])


def rms_of(angle: Array, wished: Log) -> float:
    """Rms error of the joints that move [deg]."""
    moves = np.ptp(wished.angle, axis=0) > 1e-6
    return float(np.degrees(np.sqrt(np.mean((angle - wished.angle)[:, moves] ** 2))))


@dataclass(frozen=True)
class Played:
    """Errors on a path of a machine [deg]: open loop and with feedback, of each of WAYS;
    open loop without feed-forward is the feedback alone.

    said: spans that `follow` says cannot be had. pid: the controller's gains.
    """

    machine: str
    path: str
    opened: Sequence[float]
    closed: Sequence[float]
    said: int
    pid: Sequence[float]

    @property
    def over_best(self) -> float:
        """Error open loop over the best of all others."""
        return self.opened[0] / min(self.opened[1:])

    @property
    def over_alone(self) -> float:
        """Error with feedback over that of the feedback alone."""
        return self.closed[0] / self.closed[-1]

    def show(self) -> None:
        """Print the path's row."""
        errors = [
            " ".join(f"{error:.2f}" for error in of)
            for of in (self.opened[:3], self.closed)
        ]
        ratios = f"{self.over_best:.2f}", f"{self.over_alone:.2f}"
        gains = " ".join(f"{gain:.2f}" for gain in self.pid)
        row(self.machine, self.path, *errors, *ratios, self.said, gains)


def make_case(machine: Machine | PlayedBoom, run_folder: Path) -> Case:
    """Return a machine with its fit."""
    baselines = load_record(run_folder).result.baselines
    simple = {
        name: [baselines[joint][name] for joint in sorted(baselines)]
        for name in WAYS[1:3]
    }
    return Case(machine, load_identified(run_folder), simple)


def stranger(folder: Path, seed: int, number: int) -> Case:
    """Return a random machine with its fit."""
    machine = Machine(np.random.default_rng([seed, number]), number)
    return make_case(machine, folder / f"{number:02d}" / "mine" / "runs" / "fit")


def run(name: str, case: Case, seed: int) -> list[Played]:
    """Follow every path on a machine, and print its rows."""
    pid, none, rows = tuned(case), Pid(0.0, 0.0, 0.0), list[Played]()
    for kind in PATHS:
        if kind == "tip on a line" and case.machine.joints < 2:
            continue
        wished, rng = path(case, kind), np.random.default_rng(seed)
        found = follow(case.model, wished)
        commands = {
            WAYS[0]: found.log.command[-len(wished.time) :],
            **{way: simple_commands(case, wished, way) for way in WAYS[1:3]},
            WAYS[3]: np.zeros_like(wished.angle),
        }
        opened = [
            rms_of(play(case, wished, commands[way], none, rng), wished)
            for way in WAYS[:3]
        ]
        closed = [
            rms_of(play(case, wished, commands[way], pid, rng), wished) for way in WAYS
        ]
        gains = pid.gain, pid.integral, pid.derivative
        said = len(found.missed)
        rows.append(Played(name, kind, [*opened, closed[-1]], closed, said, gains))
        rows[-1].show()
    return rows


def run_or_read(given: Any, number: int) -> list[Played]:
    """Follow the paths of a random machine, or take what lies in its folder."""
    folder = Path(given.folder)
    store = folder / f"{number:02d}" / STORE
    if given.stored:
        rows = [Played(**one) for one in json.loads(store.read_text())]
        for one in rows:
            one.show()
        return rows
    rows = run(str(number), stranger(folder, given.seed, number), given.seed)
    store.write_text(json.dumps([vars(one) for one in rows]))
    return rows


def show_totals(rows: Sequence[Played]) -> None:
    """Print medians by path and over all, and whether what went wrong was said."""
    table(
        "path | number | open loop [deg] | over the best: median | 90th percentile | "
        "with PID [deg] | over PID alone: median | 90th percentile"
    )
    for kind in (*PATHS, "all"):
        some = [one for one in rows if kind in (one.path, "all")]
        if not some:
            continue
        best = np.quantile([one.over_best for one in some], [0.5, 0.9])
        alone = np.quantile([one.over_alone for one in some], [0.5, 0.9])
        opened = np.median([one.opened[0] for one in some])
        closed = np.median([one.closed[0] for one in some])
        numbers = [f"{one:.2f}" for one in (opened, *best, closed, *alone)]
        row(kind, len(some), *numbers)
    lost = [one for one in rows if one.opened[0] > LARGE]
    said = sum(one.said > 0 for one in lost)
    print(f"\nopen loop above {LARGE:g} deg: {len(lost)}, of which {said} were said")


def main() -> None:
    numbers = {"machines": 3, "first": 0, "seed": 1}
    given = options(__doc__, **numbers, stored=False, folder="build/strangers", boom="")
    judged = "over the best | over PID alone | spans that cannot be had | gains"
    print(f"open loop: {', '.join(WAYS[:3])}; with PID: {', '.join(WAYS)}")
    table(f"machine | path | open loop [deg] | with PID [deg] | {judged}")
    rows = list[Played]()
    if given.boom:
        rows += run("boom", make_case(PlayedBoom(), Path(given.boom)), given.seed)
    machines = range(given.first, given.first + given.machines)
    for number in () if given.boom else machines:
        folder = Path(given.folder) / f"{number:02d}"
        if (folder / STORE if given.stored else folder).exists():
            rows += run_or_read(given, number)
        else:
            print(f"machine {number} is not in {given.folder}")
    if rows:
        show_totals(rows)


if __name__ == "__main__":
    main()
