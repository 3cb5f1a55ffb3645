"""A fitted arm near one pose and opening as a linear system: for scipy, python-control,
or Bode's plots.

    ẋ = A x + B u(t − delay),   y = C x + D u,

u: change of the commands [%]; y: change of the joints' angles and speeds. Each joint
has the states of its pilot stage, its plunger, its opening and its oil where it has
them, and its angle:

    pilot stage, opening: a lag each; plunger: m s² + λ s + K + 2 F/(x + δ)
    (`hydraulics.solenoid`); oil: ω² / (s² + 2 ζ ω s + ω²).

They turn a command into a wished speed, of which one static matrix says how it answers
to all openings at once (they share the pump) and another one how to the angles (lever
and load): both are differences of `Plant.speeds`. In the dynamic model ω² = C/M, with C
the stiffness of both chambers' oil and M the joint's inertia, and ζ is half of √(C M)
times what speed falls per load.
"""

import json
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import mujoco
import numpy as np
from scipy.signal import StateSpace, lsim

from hydroid.arrays import Array, Index, record
from hydroid.errors import SettingsError
from hydroid.hydraulics.cylinder import rod_way
from hydroid.hydraulics.oil import volumes
from hydroid.hydraulics.records import LINEAR, coefficients
from hydroid.hydraulics.solenoid import drive, resting_stroke, side_voltage
from hydroid.plant import Plant
from hydroid.simulation.settled import settled_speeds

NEAR_COMMAND = 0.5
"""half a difference of commands [%], over which a slope is taken"""
NEAR_ANGLE = 1e-3
"""half a difference of angles [rad], over which a slope is taken"""
SHORT = 1e-4
"""lag that is none [s]"""
COMMAND = -1
"""the command's column in the rates of a valve's states"""


@record
class LinearArm:
    """An arm linearised: K joints that take commands, X states.

    Attributes:
        a, b, c, d: shapes (X, X), (X, K), (2 K, X), (2 K, K); y are K angles [rad],
            then K speeds [rad/s].
        delay: of each command [s], (K,).
        joints: their names.
        states: names of the states.
        inputs, outputs: names of u and y, with their units: m and m/s of joints that
            slide.
        command, angle: about which it is linear [%], [rad], (K,).
        speed: at which the joints move there [rad/s], (K,): the changes are against
            this motion.
    """

    a: Array
    b: Array
    c: Array
    d: Array
    delay: Array
    joints: tuple[str, ...]
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    command: Array
    angle: Array
    speed: Array

    def step(self, k: int, time: Array) -> Array:
        """Return the change of a joint's speed [rad/s] after its command, the k-th, has
        risen by 1 % at time 0, shape (T,); times are equally spaced [s], shape (T,)."""
        given = np.zeros((len(time), len(self.joints)))
        given[:, k] = 1.0
        system = StateSpace(self.a, self.b, self.c, self.d)
        _, outputs, _ = lsim(system, given, time - time[0])
        # angles come first among the outputs
        speed = outputs[:, len(self.joints) + k]
        return np.interp(time - self.delay[k], time, speed, left=0.0)

    def response(self, k: int, frequency: Array) -> Array:
        """Return by how much a joint's speed swings per 1 % of its command, the k-th:
        complex [rad/s], shape (F,), at frequencies [Hz], shape (F,)."""
        own = len(self.joints) + k
        swing = 2j * np.pi * frequency
        matrices = swing[:, None, None] * np.eye(len(self.a)) - self.a
        command = self.b[:, k, None].astype(complex)
        states = np.linalg.solve(matrices, command)[..., 0]
        prompt = states @ self.c[own] + self.d[own, k]
        # a delay turns the phase and leaves the amplitude
        return prompt * np.exp(-swing * self.delay[k])

    def text(self) -> str:
        """Return it as JSON."""
        plain = dict[str, Any]()
        for key, value in vars(self).items():
            # matrices bear their usual names in the file: A, B, C, D
            name = key
            if len(key) == 1:
                name = key.upper()
            plain[name] = np.asarray(value).tolist()
        return json.dumps(plain, indent=1)


def linearise(plant: Plant, command: Array) -> LinearArm:
    """Return a plant of stage 2 where it stands, as a linear system about commands that
    are held [%], (J,).

    Joints without a command stand, and are no part of it.

    Raises:
        SettingsError: no joint has a command, or one is beyond 100 % or within a dead
            band, which has no slope.
    """
    joints = _moving(plant, command)
    columns: Index = np.array(joints)
    names = tuple(plant.names[joint] for joint in joints)
    valves = [_valve(plant, joint, command) for joint in joints]
    oils = [_oil(plant, joint, command) for joint in joints]
    gain, turn, speed = _slopes(plant, command, columns)

    # what states and commands do, side by side: to the states' rates, to openings and
    # to speeds
    states = _state_names(names, valves, oils)
    count = len(joints)
    total = len(states)
    first_angle = total - count
    rates = np.zeros((total, total + count))
    openings = np.zeros((count, total + count))
    first = 0
    for k, valve in enumerate(valves):
        _put_valve(valve, k, first, rates, openings)
        first += len(valve.states)
    opened = openings[:, :total]
    direct = openings[:, total:]
    speeds = np.hstack([gain @ opened, gain @ direct])
    speeds[:, first_angle:total] += turn
    for k, oil in enumerate(oils):
        if oil is not None:
            _put_oil(oil, k, first, rates, speeds)
            first += 2
    rates[first_angle:] = speeds

    # angles are states themselves
    angles = np.eye(total, total + count)[first_angle:]
    outputs = np.vstack([angles, speeds])
    delays = [_side(plant, joint, command)["delay"] for joint in joints]
    return LinearArm(
        a=rates[:, :total],
        b=rates[:, total:],
        c=outputs[:, :total],
        d=outputs[:, total:],
        delay=np.array(delays),
        joints=names,
        states=states,
        inputs=tuple(f"{name} command [%]" for name in names),
        outputs=_output_names(plant, joints),
        command=command[columns],
        angle=plant.angle[columns],
        speed=speed,
    )


def _moving(plant: Plant, command: Array) -> list[int]:
    """Return the joints with a command [%], 0-based; raises SettingsError as
    `linearise` does."""
    joints = [joint - 1 for joint in plant.joints if command[joint - 1] != 0.0]
    if not joints:
        what = "no joint has a command: around 0 is the dead band, which has no slope"
        hint = (
            "name the commands of joints that move, such as boom=30; the others stand"
        )
        raise SettingsError(what, "--at", hint)
    for joint in joints:
        _refuse_without_slope(plant, joint, command)
    return joints


def _state_names(
    names: Sequence[str], valves: "Sequence[_Valve]", oils: "Sequence[_Oil | None]"
) -> tuple[str, ...]:
    """Return the names of all states: those of all valves, then of all oils, then the
    angles."""
    states = list[str]()
    for name, valve in zip(names, valves, strict=True):
        states += [f"{name} {state}" for state in valve.states]
    for name, oil in zip(names, oils, strict=True):
        if oil is not None:
            states += [f"{name} speed", f"{name} acceleration"]
    states += [f"{name} angle" for name in names]
    return tuple(states)


def _output_names(plant: Plant, joints: Sequence[int]) -> tuple[str, ...]:
    """Return the names of joints' (0-based) angles, then of their speeds, with units."""
    angles = list[str]()
    speeds = list[str]()
    for joint in joints:
        name = plant.names[joint]
        unit = plant.identified.settings.arm.joints[joint].shown.si
        angles.append(f"{name} angle [{unit}]")
        speeds.append(f"{name} speed [{unit}/s]")
    return (*angles, *speeds)


def _refuse_without_slope(plant: Plant, joint: int, command: Array) -> None:
    """Refuse the command of a joint (0-based) about which its speed has no slope."""
    name = plant.names[joint]
    value = float(command[joint])
    # NaN is not within them either
    if not abs(value) <= 100.0:
        what = f"the command of {name} is {value:g} %"
        raise SettingsError(what, "--at", "allowed are -100 to 100 %")
    band = _side(plant, joint, command)["dead_band"]
    if abs(value) - NEAR_COMMAND < band:
        what = f"{name} at {value:g} % is within its dead band, which has no slope"
        hint = f"beyond {band + NEAR_COMMAND:.3g} % it moves that way"
        raise SettingsError(what, "--at", hint)


def _put_valve(
    valve: "_Valve", joint: int, first: int, rates: Array, openings: Array
) -> None:
    """Fill in the rates of a valve's states, from the first on, and its joint's
    opening."""
    total = len(rates)
    rows = slice(first, first + len(valve.states))
    rates[rows, rows] = valve.matrix
    rates[rows, total + joint] = valve.vector
    if valve.states:
        openings[joint, rows.stop - 1] = 1.0
    else:
        openings[joint, total + joint] = 1.0


def _put_oil(oil: "_Oil", joint: int, first: int, rates: Array, speeds: Array) -> None:
    """Let a joint's speed follow the settled one through two states, from the first
    on."""
    speed = first
    acceleration = first + 1
    drag = 2.0 * oil.damping * oil.frequency
    # the second state is the acceleration without what passes the oil at once, as in
    # `overshoot`
    passed = oil.share * drag
    rates[speed] = passed * speeds[joint]
    rates[speed, acceleration] += 1.0
    rates[acceleration] = (oil.frequency**2 - drag * passed) * speeds[joint]
    rates[acceleration, speed] -= oil.frequency**2
    rates[acceleration, acceleration] -= drag
    speeds[joint] = 0.0
    speeds[joint, speed] = 1.0


def _side(plant: Plant, joint: int, command: Array) -> dict[str, float]:
    """Return the quantities of the side that a joint (0-based) is driven towards; 0
    where the model has none."""
    actuator = plant.actuators[joint]
    end = "a" if command[joint] > 0.0 else "b"
    keys = ("delay", "pilot_lag", "plunger_damping", "dead_band", "onset")
    return {
        key: float(actuator[f"{key}_{end}"]) if plant.rung.has(key) else 0.0
        for key in keys
    }


def _slopes(plant: Plant, command: Array, columns: Index) -> tuple[Array, Array, Array]:
    """Return slopes of the K settled speeds by commands and by angles, (K, K) each, and
    the speeds, (K,)."""
    count = len(columns)
    # four rows a joint: its command more and less, its angle more and less; the last
    # row is the point itself
    commands = np.tile(command, (4 * count + 1, 1))
    poses = np.tile(plant.angle, (4 * count + 1, 1))
    for k, joint in enumerate(columns.tolist()):
        row = 4 * k
        commands[row, joint] += NEAR_COMMAND
        commands[row + 1, joint] -= NEAR_COMMAND
        poses[row + 2, joint] += NEAR_ANGLE
        poses[row + 3, joint] -= NEAR_ANGLE
    # at full command the slope is that from below
    commands = commands.clip(-100.0, 100.0)
    more = 4 * np.arange(count)
    apart = commands[more, columns] - commands[more + 1, columns]
    speeds = plant.steady().speeds(commands, poses)[:, columns]
    by_command = speeds[0:-1:4] - speeds[1:-1:4]
    by_angle = speeds[2:-1:4] - speeds[3:-1:4]
    gain = by_command.T / apart
    turn = by_angle.T / (2.0 * NEAR_ANGLE)
    return gain, turn, speeds[-1]


@record
class _Valve:
    """The S states from a joint's command to its opening, the opening last: their
    names, and their rates by themselves, (S, S), and by the command, (S,)."""

    states: tuple[str, ...]
    matrix: Array
    vector: Array


def _valve(plant: Plant, joint: int, command: Array) -> _Valve:
    """Return the states of a joint's valve (0-based), each as a part of its own final
    value."""
    actuator = plant.actuators[joint]
    side = _side(plant, joint, command)
    # from a command on, each state follows the one before it: `source` is its row
    states = list[str]()
    rates = np.zeros((4, 5))
    source = COMMAND
    if side["pilot_lag"] > SHORT:
        _put_lag(rates, len(states), source, side["pilot_lag"])
        source = len(states)
        states.append("pilot stage")

    if plant.rung.has("plunger_mass"):
        # the plunger's acceleration first: its stroke is what goes on
        speed = len(states)
        stroke = speed + 1
        states += ["plunger speed", "plunger"]
        stiffness = _plunger_stiffness(plant, joint, side, float(command[joint]))
        mass = float(actuator["plunger_mass"])
        rates[stroke, speed] = 1.0
        rates[speed, speed] = -side["plunger_damping"] / mass
        rates[speed, stroke] = -stiffness / mass
        rates[speed, source] = stiffness / mass
        source = stroke
    if plant.rung.has("opening_lag") and actuator["opening_lag"] > SHORT:
        _put_lag(rates, len(states), source, actuator["opening_lag"])
        states.append("opening")
    size = len(states)
    return _Valve(tuple(states), rates[:size, :size], rates[:size, COMMAND])


def _put_lag(rates: Array, state: int, source: int, lag: float) -> None:
    """Let a state follow another, or the command, with a lag [s]."""
    rates[state, source] = 1.0 / lag
    rates[state, state] = -1.0 / lag


def _plunger_stiffness(
    plant: Plant, joint: int, side: Mapping[str, float], command: float
) -> float:
    """Return the stiffness of spring and solenoid against the plunger where a command
    holds it [N/m]."""
    c = _coefficients(plant, joint)
    beyond = max(abs(command) - side["dead_band"], 0.0)
    voltage = side_voltage(beyond, 1.0, side["onset"], side["dead_band"])
    stroke = float(resting_stroke(drive(voltage, c), c.gap, c.plunger_stiffness))
    # the solenoid pulls harder where the gap is shorter: that adds to the spring
    solenoid = 2.0 * stroke / (stroke + c.gap)
    return float(c.plunger_stiffness * (1.0 + solenoid))


def _coefficients(plant: Plant, joint: int) -> Any:
    alone: Any = plant.actuators[None, joint : joint + 1]
    return coefficients(alone)[0, 0]


class _Oil(NamedTuple):
    """A joint on its oil: natural frequency [rad/s], damping ratio, and the share of
    the damping between valve and joint."""

    frequency: float
    damping: float
    share: float = 0.0


def _oil(plant: Plant, joint: int, command: Array) -> _Oil | None:
    """Return how a joint (0-based) rings on its oil; None where it has none."""
    rung = plant.rung
    if rung.has("bulk_modulus"):
        stiffness = _oil_stiffness(plant, joint)
        inertia = _inertia(plant, joint)
        yielding = _yielding(plant, joint, command)
        frequency = float(np.sqrt(stiffness / inertia))
        damping = 0.5 * yielding * float(np.sqrt(stiffness * inertia))
        return _Oil(frequency, damping)
    actuator = plant.actuators[joint]
    if not rung.has("oil_frequency") or np.isinf(actuator["oil_frequency"]):
        return None
    frequency = 2.0 * np.pi * float(actuator["oil_frequency"])
    damping = float(actuator["oil_damping"])
    return _Oil(frequency, damping, float(actuator["oil_damping_share"]))


def _oil_stiffness(plant: Plant, joint: int) -> float:
    """Return the stiffness of the oil in both chambers against a joint (0-based)
    [N·m/rad]."""
    c = _coefficients(plant, joint)
    travel, arm = rod_way(c, float(plant.angle[joint]))
    if c.kind != LINEAR:
        return 2.0 * (arm * c.a.area) ** 2 * c.bulk_modulus / c.dead_volume
    volume_a, volume_b = volumes(travel, c)
    side_a = c.a.area**2 / volume_a
    side_b = c.b.area**2 / volume_b
    return arm**2 * c.bulk_modulus * (side_a + side_b)


def _yielding(plant: Plant, joint: int, command: Array) -> float:
    """Return how much settled speed a joint (0-based) loses per load
    [rad/s per N·m]."""
    steady = plant.steady()
    columns = steady.columns
    column = int(np.flatnonzero(columns == joint)[0])
    pose = plant.angle[None]
    load = steady.weighing.loads(pose)[:, columns]
    change = 0.01 * max(float(np.abs(load).max()), 1.0)
    poses = np.repeat(pose[:, columns], 2, axis=0)
    loads = np.repeat(load, 2, axis=0)
    loads[:, column] += [change, -change]
    commands = np.repeat(command[None, columns], 2, axis=0)
    speeds = settled_speeds(steady.plugin, poses, loads, commands, steady.rung)
    return float(speeds[1, column] - speeds[0, column]) / (2.0 * change)


def _inertia(plant: Plant, joint: int) -> float:
    """Return the inertia of a joint (0-based) in the plant's pose, the others at rest
    [kg·m²]."""
    model = plant.model
    data = mujoco.MjData(model)
    data.qpos[:] = plant.data.qpos
    mujoco.mj_forward(model, data)
    full = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, full)
    row = int(np.flatnonzero(plant.parts.columns == joint)[0])
    return float(full[row, row])
