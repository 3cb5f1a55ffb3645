"""Random machines whose equations are not hydroid's: their arm, their logs, what the
logs leave of them.

Nothing of hydroid simulates a machine. It is recorded as with sticks, with jitter.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numba import njit
from numpy.random import Generator
from robots import LIMIT, body, joint

from hydroid.arrays import Array

STEP = 0.002
"""of the integration [s]"""
GRAVITY = 9.81
NAMES = ("swing", "boom", "arm", "bucket", "wrist", "tool")
KNOTS = np.array([0.0, 0.15, 0.4, 0.7, 1.0])
"""parts of a command beyond the dead band between which a valve that is odd opens
evenly"""
FALLS, SATURATES, OPEN_CENTRE = 0, 1, 2
"""of a shared pump: its pressure falls with the flow; it holds its pressure up to a
flow; what no joint takes runs through the valves' open centres"""


class Machine:
    """A random machine of J joints; a `vertical` axis only swings, the others lift for
    positive angles.

    length [m], mass [kg]: of the links, (J,). ends: of the joints' ranges [rad], (J,
    2). full: speed at full command without load in both directions [rad/s], (J, 2).
    dead [%], exponent: (J, 2). delay, lag [s], (J,). early: whether the lag is before
    the dead band. load: torque of gravity at which a joint stands still [N·m], (J,);
    friction: the same as a part of it. lever: change of the moment arm over the range,
    0 of a rotary actuator, (J,). droop: fall of the supply at the pump's full flow, 0
    without a shared pump. draw: flow of each direction at full speed, as a part of the
    pump's, (J, 2). stiff: square of the frequency of oil and inertia [rad²/s²], (J,),
    0: unseen; ratio: its damping ratio. noise [rad], rate [Hz]: of the logs.

    An odd one also has: curve: part of the opening that the power law gives at KNOTS,
    (J, 2, 5). neutral: command at which a spool rests [%], (J,). slow: whether the
    speed lags, and not the valve, (J,). on_off: whether a joint's commands are all or
    nothing, (J,). line: what its shared pump does.
    """

    def __init__(
        self, rng: Generator, number: int, odd: Generator | None = None
    ) -> None:
        joints = int(rng.integers(3, 7))
        swings = joints > 3 or rng.random() < 0.5
        chain = slice(0 if swings else 1, joints + (not swings))
        self.names, self.joints = NAMES[chain], joints
        size = 10 ** rng.uniform(np.log10(0.2), np.log10(20))  # t
        self.length = (
            2.2
            * size ** (1 / 3)
            * np.array([0.3, 1.0, 0.7, 0.35, 0.3, 0.25, 0.25])[chain]
        )
        self.mass = (
            1000 * size * np.array([0.45, 0.12, 0.07, 0.04, 0.02, 0.015, 0.015])[chain]
        )
        ranges = {
            "swing": (-120, 120),
            "boom": (-30, 60),
            "arm": (-140, -25),
            "bucket": (-120, 30),
        }
        self.ends = np.radians([ranges.get(name, (-60, 60)) for name in self.names])
        self.vertical = np.array([name == "swing" for name in self.names])
        self.full = np.radians(rng.uniform(8, 40, (joints, 1))) * rng.uniform(
            0.7, 1.4, (joints, 2)
        )
        self.dead = np.clip(
            rng.choice([5.0, 20.0, 40.0]) + rng.normal(0, 4, (joints, 2)), 0, 60
        )
        exponent = rng.uniform(0.7, 3.0, (joints, 1)) * rng.uniform(
            0.9, 1.1, (joints, 2)
        )
        self.exponent = np.clip(exponent, 0.7, 3.0)
        self.draw = np.tile(rng.uniform(0.2, 0.6, (joints, 1)), (1, 2))
        if rng.random() < 1 / 3:
            self.draw *= rng.uniform(0.3, 1.0, (joints, 2))
        own = gravity_torque(
            self.ends.mean(axis=1), self.vertical, self.length, self.mass
        )
        reach = np.maximum(np.abs(own), 0.3 * GRAVITY * self.mass * self.length)
        self.delay = np.full(joints, rng.uniform(0, 0.4)) * rng.uniform(
            0.8, 1.0, joints
        )
        self.lag = rng.uniform(0.02, 0.25, joints)
        self.early = rng.random(joints) < 0.3
        self.load = reach * rng.uniform(2, 5, joints)
        self.friction = rng.uniform(0, 0.1, joints)
        straight = self.vertical | (rng.random(joints) < 0.4)
        self.lever = np.where(straight, 0.0, rng.uniform(0.1, 0.4, joints))
        self.droop = float(rng.uniform(0.2, 0.6)) if number % 2 == 0 else 0.0
        visible = number % 4 < 2
        self.stiff = (
            (2 * np.pi * rng.uniform(0.8, 4.0, joints)) ** 2
            if visible
            else np.zeros(joints)
        )
        self.ratio = rng.uniform(0.1, 0.6, joints)
        self.noise = np.radians(10 ** rng.uniform(np.log10(0.02), np.log10(0.2)))
        self.rate = float(rng.choice([10, 20, 50, 100]))
        self.curve = np.tile(KNOTS, (joints, 2, 1))
        self.neutral = np.zeros(joints)
        self.slow = np.zeros(joints, dtype=bool)
        self.on_off = np.zeros(joints, dtype=bool)
        self.line = FALLS
        if odd is not None:
            self._make_odd(odd)

    def _make_odd(self, rng: Generator) -> None:
        """Give the joints valves that no exponent describes, and the machine another
        pump."""
        joints = self.joints
        kind = rng.choice(["bends", "all at once", "power law"], joints)
        bends = np.cumsum(rng.gamma(1.0, size=(joints, 2, len(KNOTS) - 1)), axis=2)
        self.curve[kind == "bends", :, 1:] = (bends / bends[:, :, -1:])[kind == "bends"]
        sudden = 0.6 + 0.4 * KNOTS[1:]
        self.curve[kind == "all at once", :, 1:] = sudden
        off_centre = rng.random(joints) < 0.4
        self.neutral = np.where(off_centre, rng.uniform(-25, 25, joints), 0.0)
        self.slow = ~self.early & (rng.random(joints) < 0.5)
        self.on_off = rng.random(joints) < 0.2
        if self.droop:
            self.line = int(rng.choice([SATURATES, OPEN_CENTRE]))

    @property
    def is_bent(self) -> bool:
        """Whether the curve of any valve is not its power law."""
        return bool((self.curve != KNOTS).any())

    @property
    def rises(self) -> Array:
        """By how much each valve's curve rises between KNOTS, (J, 2, 4); where it is
        set, only their proportions count."""
        return np.diff(self.curve, axis=2)

    @rises.setter
    def rises(self, rises: Array) -> None:
        if not self.is_bent:
            return
        self.curve = np.zeros_like(self.curve)
        self.curve[:, :, 1:] = np.cumsum(rises, axis=2)
        self.curve /= self.curve[:, :, -1:]

    @property
    def terms(self) -> Any:
        """Whether a shared pump, oil, and each joint's lag before its dead band show,
        (2 + J,)."""
        return np.array([self.droop > 0, self.stiff.any(), *self.early])

    def simulate(self, command: Array, start: Array) -> Array:
        """Angles [rad], (T, J), under commands of STEP [s] and %, (T, J)."""
        return self.go_on(command, self.at_rest(start), 0)

    def at_rest(self, start: Array) -> Array:
        """What a machine carries from step to step, at rest at angles [rad], (J,):
        shape (4, J)."""
        carry = np.zeros((4, self.joints))
        carry[0] = start
        return carry

    def go_on(self, command: Array, carry: Array, first: int) -> Array:
        """Angles [rad] from step `first` on, under commands from the start on, (T, J);
        changes `carry`."""
        sided = (
            *self.ends.T,
            *self.full.T,
            *self.dead.T,
            *self.exponent.T,
            *self.draw.T,
        )
        single = (
            self.length,
            self.mass,
            self.lag,
            self.early,
            self.load,
            self.friction,
            self.lever,
        )
        numbers = np.array([*single, self.stiff, self.ratio, *sided], float)
        late = np.round(self.delay / STEP).astype(np.int64)
        valves = self.neutral, self.curve, self.slow
        how = late, self.vertical, numbers, valves, self.droop, self.line
        return integrate(np.ascontiguousarray(command), carry, first, *how)


@njit(cache=True)
def gravity_torque(angle: Array, vertical: Any, length: Array, mass: Array) -> Array:
    """Torque that holds each joint [N·m], (J,): a planar chain, each link's mass in its
    middle."""
    pitch, carried, moment = 0.0, 0.0, 0.0
    along, torque = np.zeros(len(angle)), np.zeros(len(angle))
    for j in range(len(angle)):
        pitch += 0.0 if vertical[j] else angle[j]
        along[j] = 0.0 if vertical[j] else length[j] * np.cos(pitch)
    for j in range(len(angle) - 1, -1, -1):
        moment += along[j] * (0.5 * mass[j] + carried)
        carried += mass[j]
        torque[j] = 0.0 if vertical[j] else GRAVITY * moment
    return torque


@njit(cache=True)
def opening(
    signal: float, dead: Array, exponent: Array, neutral: float, curve: Array
) -> float:
    """Part of the full speed, with its sign, that a signal [%] asks for."""
    side = 0 if signal >= neutral else 1
    edge = dead[side] + (neutral if side == 0 else -neutral)
    beyond = max(abs(signal) - max(edge, 0.0), 0.0) / (100.0 - max(edge, 0.0))
    if (signal > 0) != (side == 0):  # between neutral and zero command
        beyond = 0.0
    part = beyond ** exponent[side]
    bent = curve[side]
    for k in range(len(KNOTS) - 1):
        if KNOTS[k] < part <= KNOTS[k + 1]:
            steep = (bent[k + 1] - bent[k]) / (KNOTS[k + 1] - KNOTS[k])
            if steep != 1.0:
                part = bent[k] + steep * (part - KNOTS[k])
            break
    return (1.0 if side == 0 else -1.0) * part


@njit(cache=True)
def is_too_high(supply: float, taken: float, part: Array, droop: float, line: int):
    """Whether a shared pump cannot hold a supply pressure under which joints with these
    openings take a flow."""
    if line == SATURATES:
        return taken > 1.0 - droop
    if line == OPEN_CENTRE:
        past = 2.0 * (1.0 - np.max(np.abs(part))) * np.sqrt(supply)
        return taken + past > 1.0
    return 1.0 - droop * taken <= supply


@njit(cache=True)
def part_of_speed(
    supply: float, part: float, lift: float, friction: float, turn: float
) -> float:
    """Part of a joint's full speed at a supply pressure, without its sign."""
    against = np.sign(part) * lift + friction * abs(np.sign(part))
    return abs(part) * np.sqrt(max(supply - against, 0.0)) * turn


@njit(cache=True)
def integrate(
    command: Array,
    carry: Array,
    first: int,
    late: Any,
    vertical: Any,
    numbers: Array,
    valves: Any,
    droop: float,
    line: int,
) -> Array:
    """Angles [rad] from step `first` on, under commands of STEP [s] and %, (T, J).

    `carry` has angle, held signal, speed and force, (4, J); `numbers` and `valves` as
    in `Machine.go_on`.
    """
    neutral, curve, slow = valves
    steps, joints = command.shape
    length, mass, lag, early, load, friction, lever, stiff, ratio, lower, upper = (
        numbers[:11]
    )
    full, dead, exponent, draw = (
        numbers[11:13],
        numbers[13:15],
        numbers[15:17],
        numbers[17:19],
    )
    angle, held, speed, force = carry[0], carry[1], carry[2], carry[3]
    found = np.empty((steps - first, joints))
    part, turn, lift = np.zeros(joints), np.zeros(joints), np.zeros(joints)
    for k in range(first, steps):
        found[k - first] = angle
        torque = gravity_torque(angle, vertical, length, mass)
        for j in range(joints):
            u = command[k - late[j], j] if k >= late[j] else 0.0
            valve = dead[:, j], exponent[:, j], neutral[j], curve[j]
            target = u if early[j] else opening(u, *valve)
            if slow[j]:
                part[j] = target
            else:
                held[j] += (target - held[j]) * (1.0 - np.exp(-STEP / lag[j]))
                part[j] = opening(held[j], *valve) if early[j] else held[j]
            middle = (angle[j] - 0.5 * (lower[j] + upper[j])) / (upper[j] - lower[j])
            turn[j] = 1.0 / (1.0 - lever[j] * (2.0 * middle) ** 2)
            lift[j] = torque[j] * turn[j] / load[j]  # what turns faster holds less
        low, high, supply = 0.0, 1.0, 1.0
        if droop > 0:
            for _ in range(30):
                supply = 0.5 * (low + high)
                taken = 0.0
                for j in range(joints):
                    rate = part_of_speed(supply, part[j], lift[j], friction[j], turn[j])
                    taken += rate / turn[j] * draw[0 if part[j] >= 0 else 1, j]
                if is_too_high(supply, taken, part, droop, line):
                    high = supply
                else:
                    low = supply
        for j in range(joints):
            rate = part_of_speed(supply, part[j], lift[j], friction[j], turn[j])
            wanted = np.sign(part[j]) * full[0 if part[j] >= 0 else 1, j] * rate
            if slow[j]:
                held[j] += (wanted - held[j]) * (1.0 - np.exp(-STEP / lag[j]))
                wanted = held[j]
            # oil: a spring between what the valve lets through and the arm
            if stiff[j] > 0:
                force[j] += STEP * stiff[j] * (wanted - speed[j])
                speed[j] += STEP * (
                    force[j] - 2.0 * ratio[j] * np.sqrt(stiff[j]) * (speed[j] - wanted)
                )
            else:
                speed[j] = wanted
            angle[j] += STEP * speed[j]
            if angle[j] < lower[j] or angle[j] > upper[j]:
                angle[j], speed[j], force[j] = (
                    min(max(angle[j], lower[j]), upper[j]),
                    0.0,
                    0.0,
                )
    return found


def stick(rng: Generator, m: Machine, seconds: float) -> tuple[Array, Array]:
    """Commands as a person gives them, kept off the stops, with the angles that
    follow."""
    steps, (lower, upper) = round(seconds / STEP), m.ends.T
    start, margin = (
        lower + (upper - lower) * rng.uniform(0.35, 0.65, m.joints),
        0.04 * (upper - lower),
    )
    command, angle, block = (
        np.zeros((steps, m.joints)),
        np.tile(start, (steps, 1)),
        round(10.0 / STEP),
    )
    for first in range(0, steps, block):
        last = min(first + block, steps)
        trial, moved = command, angle
        for _ in range(12):
            trial = command.copy()
            for j in range(m.joints):
                k = first or round(1.0 / STEP)
                while k < last:
                    hold = round(rng.uniform(0.5, 3.0) / STEP)
                    level = (
                        rng.choice([-1, 1]) * rng.uniform(0.3, 1.0) * 100
                        if rng.random() < 0.6
                        else 0.0
                    )
                    ramp = min(round(rng.uniform(0.05, 0.5) / STEP), hold)
                    if m.on_off[j]:
                        level = 100.0 * np.sign(level)
                        ramp = 1
                    end = min(k + hold, last)
                    part = np.minimum(np.arange(1, end - k + 1) / max(ramp, 1), 1.0)
                    trial[k:end, j] = trial[k - 1, j] + (level - trial[k - 1, j]) * part
                    k = end
            for again in (True, False):
                moved = m.simulate(trial[:last], start)
                bad = np.any(
                    (moved < lower + margin) | (moved > upper - margin), axis=0
                )
                if again and bad.any():
                    factor = rng.uniform(-1.0, 0.6)
                    trial[first:last, bad & ~m.on_off] *= factor
                    trial[first:last, bad & m.on_off] *= -1.0 if factor < -0.2 else 0.0
            if not bad.any():
                break
        command, angle[:last] = trial, moved
    return command, angle


def write_machine(folder: Path, m: Machine, rng: Generator) -> list[Path]:
    """Write the URDF and three logs; the last is the unseen one."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "robot.urdf").write_text(urdf(m))
    logs = [folder / f"log_{number}.csv" for number in (1, 2, 3)]
    header = [
        "time_s",
        *(f"u_{n}_pct" for n in m.names),
        *(f"q_{n}_deg" for n in m.names),
    ]
    for path in logs:
        command, angle = stick(
            rng, m, 60.0 if path is logs[-1] else float(rng.uniform(40, 120))
        )
        times = np.arange(0, len(command) * STEP - STEP, 1 / m.rate)
        times[1:] += rng.uniform(-0.1, 0.1, len(times) - 1) / m.rate
        at = np.minimum(np.round(times / STEP).astype(int), len(command) - 1)
        noisy = np.degrees(angle[at] + rng.normal(0, m.noise, (len(at), m.joints)))
        table = np.column_stack([at * STEP, command[at], noisy])
        np.savetxt(
            path, table, delimiter=",", header=",".join(header), comments="", fmt="%.4f"
        )
    return logs


def urdf(m: Machine, turned: int | None = None) -> str:
    """The machine as its maker's CAD exports it; the axis of joint `turned` (from 0) is
    turned round."""
    text, parent, x = '<robot name="stranger"><link name="base"/>', "base", 0.0
    for j, name in enumerate(m.names):
        wide, vertical = 0.15 * m.length[j], m.vertical[j]
        long, reach = (wide, 0.0) if vertical else (m.length[j], m.length[j])
        middle, shape = f"{reach / 2} 0 0", f'<box size="{long} {wide} {wide}"/>'
        text += body(
            f"{name}_link",
            (long, wide, wide),
            m.mass[j],
            shape,
            centre=middle,
            seen=middle,
        )
        axis = "0 0 1" if vertical else "0 1 0" if j == turned else "0 -1 0"
        limit = LIMIT.format(*m.ends[j])
        text += joint(
            name, parent, f"{name}_link", at=f"{x} 0 0", axis=axis, limit=limit
        )
        parent, x = f"{name}_link", reach
    return f"{text}</robot>\n"


@dataclass(frozen=True)
class Recording:
    """A log as its file has it, at T times [s], (T,): commands [%] and angles [rad] of
    J joints, (T, J)."""

    time: Array
    command: Array
    angle: Array

    @property
    def start(self) -> Array:
        """The angles before the first command [rad], (J,)."""
        first = np.flatnonzero(np.any(self.command != 0, axis=1))[0]
        return self.angle[: max(first, 1)].mean(axis=0)

    @property
    def grid(self) -> Array:
        """Times of STEP from the first sample to the last one [s], (S,)."""
        return np.arange(0, self.time[-1] + STEP, STEP)

    @property
    def held(self) -> Array:
        """Commands of STEP, each held until the next sample [%], (S, J)."""
        return self.command[np.searchsorted(self.time, self.grid, side="right") - 1]


def read_recording(path: Path) -> Recording:
    """Read a log of `write_machine`."""
    table = np.loadtxt(path, delimiter=",", skiprows=1)
    time, signals = table[:, 0], table[:, 1:]
    command, angle = np.hsplit(signals, 2)
    return Recording(time, command, np.radians(angle))


def errors(simulated: Array, time: Array, angle: Array) -> Array:
    """Measured minus simulated angles [rad], (T, J), at T times [s]; those simulated,
    (S, J), are of STEP."""
    grid = np.arange(len(simulated)) * STEP
    return angle - np.column_stack([np.interp(time, grid, one) for one in simulated.T])


def rms_deg(error: Array) -> Array:
    """Rms of errors [rad], (T, J), by joint [deg], (J,)."""
    return np.degrees(np.sqrt(np.mean(error**2, axis=0)))


def floor(m: Machine, recording: Recording, time: Array, angle: Array) -> Array:
    """Rms error of the true machine under the commands of a log, by joint [deg], (J,).

    The logged commands are held, and the machine starts where the log does: what lies
    between two samples is lost to every model. It is compared with angles [rad], (T,
    J), at times [s], (T,).
    """
    return rms_deg(errors(m.simulate(recording.held, recording.start), time, angle))
