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
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path

import numpy as np
from common import options, row, table
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

    machine: Machine
    model: IdentifiedModel
    simple: dict[str, list[Baseline]]

    @property
    def period(self) -> float:
        """Of the logs [s]."""
        return self.model.settings.log.period_s

    @property
    def top(self) -> Array:
        """Speed of each joint that the logs show in both directions [rad/s], (J,)."""
        tables = [one.table for one in self.simple["speed tables"]]
        return np.array(
            [min(np.max(t[:, 1]), -np.min(t[:, 1])) for t in tables if t is not None]
        )

    @property
    def late(self) -> Array:
        """Delay and lag of each joint, by nine numbers [s], (J,)."""
        return np.array(
            [one.delay + one.numbers[3].mean() for one in self.simple["nine numbers"]]
        )


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
    """Commands [%] at which a simple model has speeds [rad/s]; full ones where it has
    not."""
    if one.table is not None:
        commands, speeds = one.table.T
        rising = np.sign(speeds[-1] - speeds[0])
        order = np.maximum.accumulate(rising * speeds)
        return np.interp(
            rising * speed, order + 1e-12 * np.arange(len(order)), commands
        ) * (speed != 0)
    dead, exponent, full = one.numbers[:3]
    side = np.where(speed / full[0] > 0, 0, 1)
    part = np.clip(np.abs(speed / full[side]), 0.0, 1.0) ** (1.0 / exponent[side])
    return np.where(
        speed == 0, 0.0, (1.0 - 2.0 * side) * (dead[side] + (100.0 - dead[side]) * part)
    )


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
    machine, count = case.machine, round(case.period / STEP)
    controller = Controller(pid, case)
    carry, given = (
        machine.at_rest(wished.angle[0]),
        np.zeros((len(command) * count, machine.joints)),
    )
    angle = np.empty_like(command)
    forward = ahead(wished, case.late) if command.any() else np.zeros_like(command)
    for k, one in enumerate(command):
        angle[k] = carry[0]
        error = (
            wished.angle[k] - angle[k] - rng.normal(0.0, machine.noise, machine.joints)
        )
        at = slice(k * count, (k + 1) * count)
        given[at] = np.clip(
            one + correction(case, forward[k], controller.speed(error)), -100.0, 100.0
        )
        machine.go_on(given[: at.stop], carry, at.start)
    return angle


def correction(case: Case, forward: Array, more: Array) -> Array:
    """What is added to commands [%] for more speed [rad/s] beside that which they
    already ask for."""
    asked = np.where(np.abs(forward + more) < QUIET * case.top, 0.0, forward + more)
    before = np.where(np.abs(forward) < QUIET * case.top, 0.0, forward)
    models = case.simple["nine numbers"]
    pairs = zip(models, asked, before, strict=True)
    return np.array(
        [float(inverse(m, np.array(a)) - inverse(m, np.array(b))) for m, a, b in pairs]
    )


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
    open loop without feed-forward is the feedback alone."""

    opened: Sequence[float]
    closed: Sequence[float]
    said: int

    @property
    def over_best(self) -> float:
        """Error open loop over the best of all others."""
        return self.opened[0] / min(self.opened[1:])

    @property
    def over_alone(self) -> float:
        """Error with feedback over that of the feedback alone."""
        return self.closed[0] / self.closed[-1]


def run(folder: Path, seed: int, number: int) -> list[Played]:
    """Follow every path on a machine, and print its rows."""
    run_folder = folder / f"{number:02d}" / "mine" / "runs" / "fit"
    machine = Machine(np.random.default_rng([seed, number]), number)
    baselines = load_record(run_folder).result.baselines
    names = WAYS[1:3]
    simple = {
        name: [baselines[joint][name] for joint in sorted(baselines)] for name in names
    }
    case = Case(machine, load_identified(run_folder), simple)
    pid, none, rows = tuned(case), Pid(0.0, 0.0, 0.0), list[Played]()
    for kind in PATHS:
        wished, rng = path(case, kind), np.random.default_rng([seed, number, 1])
        found = follow(case.model, wished)
        commands = {
            WAYS[0]: found.log.command[-len(wished.time) :],
            **{name: simple_commands(case, wished, name) for name in names},
            WAYS[3]: np.zeros_like(wished.angle),
        }
        opened = [
            rms_of(play(case, wished, commands[name], none, rng), wished)
            for name in WAYS[:3]
        ]
        closed = [
            rms_of(play(case, wished, commands[name], pid, rng), wished)
            for name in WAYS
        ]
        one = Played([*opened, closed[-1]], closed, len(found.missed))
        rows.append(one)
        cells = [
            " ".join(f"{error:.2f}" for error in errors) for errors in (opened, closed)
        ]
        parts = f"{one.over_best:.2f}", f"{one.over_alone:.2f}"
        gains = f"{pid.gain:.1f} {pid.integral:.2f} {pid.derivative:.2f}"
        row(number, kind, *cells, *parts, one.said, gains)
    return rows


def main() -> None:
    given = options(__doc__, machines=3, first=0, seed=1, folder="build/strangers")
    judged = "over the best | over PID alone | spans that cannot be had | gains"
    print(f"open loop: {', '.join(WAYS[:3])}; with PID: {', '.join(WAYS)}")
    table(f"machine | path | open loop [deg] | with PID [deg] | {judged}")
    rows = list[Played]()
    for number in range(given.first, given.first + given.machines):
        if (Path(given.folder) / f"{number:02d}").is_dir():
            rows += run(Path(given.folder), given.seed, number)
        else:
            print(f"machine {number} is not in {given.folder}")
    best = np.median([one.over_best for one in rows])
    alone = np.median([one.over_alone for one in rows])
    opened = np.median([one.opened[0] for one in rows])
    closed = np.median([one.closed[0] for one in rows])
    lost = [one for one in rows if one.opened[0] > LARGE]
    said = sum(one.said > 0 for one in lost)
    print(f"\nmedian of {len(rows)} paths: open loop {opened:.2f} deg,")
    print(f"{best:.2f} of the best of the others and of PID alone;")
    print(f"with PID {closed:.2f} deg, {alone:.2f} of PID alone")
    print(f"open loop above {LARGE:g} deg: {len(lost)}, of which {said} were said")


if __name__ == "__main__":
    main()
