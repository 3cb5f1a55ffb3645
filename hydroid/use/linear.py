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
from typing import Any

import mujoco
import numpy as np

from hydroid.arrays import Array, Index, record
from hydroid.errors import SettingsError
from hydroid.hydraulics.cylinder import volume
from hydroid.hydraulics.records import LINEAR, coefficients
from hydroid.hydraulics.solenoid import drive, resting_stroke, side_voltage
from hydroid.plant import Plant
from hydroid.simulation.quasi_static import linkage
from hydroid.simulation.settled import settled_speeds

NEAR_COMMAND, NEAR_ANGLE = 0.5, 1e-3
"""half a difference of commands [%], and of angles [rad]"""
SHORT = 1e-4  # lag that is none [s]


@record
class LinearArm:
    """An arm linearised: K joints that take commands, X states.

    Attributes:
        a, b, c, d: shapes (X, X), (X, K), (2 K, X), (2 K, K); y are K angles [rad],
            then K speeds [rad/s].
        delay: of each command [s], (K,).
        joints: their names.
        states: names of the states.
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
    command: Array
    angle: Array
    speed: Array

    def text(self) -> str:
        """Return it as JSON."""
        named = {
            key.upper() if len(key) == 1 else key: value
            for key, value in vars(self).items()
        }
        return json.dumps(
            {key: np.asarray(value).tolist() for key, value in named.items()}, indent=1
        )


def linearise(plant: Plant, command: Array) -> LinearArm:
    """Return a plant of stage 2 where it stands, as a linear system about commands that
    are held [%], (J,).

    Raises:
        SettingsError: a joint stands at a command of 0, where a dead band has no slope.
    """
    columns: Index = np.array(plant.joints) - 1
    names = tuple(plant.names[column] for column in columns.tolist())
    if idle := [
        name
        for name, one in zip(names, command[columns].tolist(), strict=True)
        if one == 0.0
    ]:
        what = f"{', '.join(idle)} at a command of 0 has a dead band, and no slope"
        raise SettingsError(
            what, "--at", "name a command of every joint, such as boom=30"
        )
    valves = [_valve(plant, joint, float(command[joint])) for joint in columns.tolist()]
    oils = [_oil(plant, joint, command) for joint in columns.tolist()]
    count = len(columns)
    valve_ends = np.cumsum([len(states) for states, *_ in valves])
    ringing = [k for k, oil in enumerate(oils) if oil is not None]
    first_oil = int(valve_ends[-1])
    first_angle = first_oil + 2 * len(ringing)
    total = first_angle + count
    a, b = np.zeros((total, total)), np.zeros((total, count))
    opened, direct = np.zeros((count, total)), np.zeros((count, count))
    states: list[str] = []
    for k, (labels, matrix, vector) in enumerate(valves):
        part = slice(int(valve_ends[k]) - len(labels), int(valve_ends[k]))
        a[part, part], b[part, k] = matrix, vector
        if labels:
            opened[k, part.stop - 1] = 1.0
        else:
            direct[k, k] = 1.0
        states += [f"{names[k]} {label}" for label in labels]
    gain, turn, speed = _slopes(plant, command, columns)
    moved, fed = gain @ opened, gain @ direct
    moved[:, first_angle:] += turn
    for place, k in enumerate(ringing):
        pace, ratio, share = oils[k] or (0.0, 0.0, 0.0)
        one, two = first_oil + 2 * place, first_oil + 2 * place + 1
        drag = 2.0 * ratio * pace
        # the state is v̇ − 2ζωσu, as in `overshoot`
        passed = share * drag
        a[one], b[one] = passed * moved[k], passed * fed[k]
        a[one, two] += 1.0
        wanted = pace**2 - drag * passed
        a[two], b[two] = wanted * moved[k], wanted * fed[k]
        a[two, one] -= pace**2
        a[two, two] -= drag
        moved[k], fed[k] = 0.0, 0.0
        moved[k, one] = 1.0
        states += [f"{names[k]} speed", f"{names[k]} acceleration"]
    a[first_angle:], b[first_angle:] = moved, fed
    states += [f"{name} angle" for name in names]
    angles = np.eye(total)[first_angle:]
    c, d = np.vstack([angles, moved]), np.vstack([np.zeros_like(fed), fed])
    delay = np.array(
        [_side(plant, joint, command)["delay"] for joint in columns.tolist()]
    )
    return LinearArm(
        a,
        b,
        c,
        d,
        delay,
        names,
        tuple(states),
        command[columns],
        plant.angle[columns],
        speed,
    )


def _side(plant: Plant, joint: int, command: Array) -> dict[str, float]:
    """Return the quantities of the side that a joint (0-based) is driven towards."""
    one, end = plant.actuators[joint], "a" if command[joint] > 0.0 else "b"
    keys = ("delay", "pilot_lag", "plunger_damping", "dead_band", "onset")
    return {key: float(one[f"{key}_{end}"]) for key in keys}


def _slopes(plant: Plant, command: Array, columns: Index) -> tuple[Array, Array, Array]:
    """Slopes of the K settled speeds by commands and by angles, (K, K) each, and the
    speeds, (K,)."""
    steady, count = plant.steady(), len(columns)
    commands, poses = (
        np.tile(command, (4 * count + 1, 1)),
        np.tile(plant.angle, (4 * count + 1, 1)),
    )
    for k, joint in enumerate(columns.tolist()):
        commands[[4 * k, 4 * k + 1], joint] += [NEAR_COMMAND, -NEAR_COMMAND]
        poses[[4 * k + 2, 4 * k + 3], joint] += [NEAR_ANGLE, -NEAR_ANGLE]
    speeds = steady.speeds(commands, poses)[:, columns]
    gain = (speeds[0:-1:4] - speeds[1:-1:4]).T / (2.0 * NEAR_COMMAND)
    turn = (speeds[2:-1:4] - speeds[3:-1:4]).T / (2.0 * NEAR_ANGLE)
    return gain, turn, speeds[-1]


def _valve(plant: Plant, joint: int, command: float) -> tuple[list[str], Array, Array]:
    """States from a joint's command to its opening, each as a part of it: names, their
    matrix and input."""
    one = plant.actuators[joint]
    side = _side(
        plant, joint, np.where(np.arange(len(plant.names)) == joint, command, 0.0)
    )
    c = _coefficients(plant, joint)
    beyond = abs(command) - side["dead_band"]
    pull = drive(
        side_voltage(max(beyond, 0.0), 1.0, side["onset"], side["dead_band"]), c
    )
    stroke = float(resting_stroke(pull, c.gap, c.plunger_stiffness))
    stiffness = float(c.plunger_stiffness * (1.0 + 2.0 * stroke / (stroke + c.gap)))
    damping, mass = side["plunger_damping"], float(one["plunger_mass"])
    names, lags = list[str](), list[float]()
    if side["pilot_lag"] > SHORT:
        names.append("pilot stage")
        lags.append(side["pilot_lag"])
    size = len(names) + 2 + (one["opening_lag"] > SHORT)
    matrix, vector = np.zeros((size, size)), np.zeros(size)
    if lags:
        matrix[0, 0], vector[0] = -1.0 / lags[0], 1.0 / lags[0]
    # the plunger's acceleration first: its stroke is what goes on
    fast, at = len(names), len(names) + 1
    names += ["plunger speed", "plunger"]
    matrix[at, fast] = 1.0
    matrix[fast, fast], matrix[fast, at] = -damping / mass, -stiffness / mass
    if lags:
        matrix[fast, 0] = stiffness / mass
    else:
        vector[fast] = stiffness / mass
    if one["opening_lag"] > SHORT:
        names.append("opening")
        matrix[at + 1, at], matrix[at + 1, at + 1] = (
            1.0 / one["opening_lag"],
            -1.0 / one["opening_lag"],
        )
    return names, matrix, vector


def _coefficients(plant: Plant, joint: int) -> Any:
    alone: Any = plant.actuators[None, joint : joint + 1]
    return coefficients(alone)[0, 0]


def _oil(plant: Plant, joint: int, command: Array) -> tuple[float, float, float] | None:
    """Natural frequency [rad/s] and damping ratio of a joint on its oil, and the share
    of the damping between valve and joint; None where it has none."""
    one = plant.actuators[joint]
    if plant.quasi_static:
        if np.isinf(one["oil_frequency"]):
            return None
        pace = 2.0 * np.pi * float(one["oil_frequency"])
        return pace, float(one["oil_damping"]), float(one["oil_damping_share"])
    c = _coefficients(plant, joint)
    travel, arm = linkage(c, float(plant.angle[joint]))
    stiffness = 2.0 * (arm * c.a.area) ** 2 * c.bulk_modulus / c.dead_volume
    if c.kind == LINEAR:
        side_a = c.a.area**2 / volume(travel, c.a.area, c.dead_volume)
        side_b = c.b.area**2 / volume(c.stroke - travel, c.b.area, c.dead_volume)
        stiffness = arm**2 * c.bulk_modulus * (side_a + side_b)
    inertia = _inertia(plant, joint)
    steady = plant.steady()
    columns, pose = steady.columns, plant.angle[None]
    load = steady.weighing.loads(pose)[:, columns]
    place, change = (
        int(np.flatnonzero(columns == joint)[0]),
        0.01 * max(float(np.abs(load).max()), 1.0),
    )
    loads = np.repeat(load, 2, axis=0)
    loads[:, place] += [change, -change]
    two = (
        np.repeat(pose[:, columns], 2, axis=0),
        loads,
        np.repeat(command[None, columns], 2, axis=0),
    )
    speeds = settled_speeds(steady.plugin, *two, quasi_static=False)[:, place]
    yielding = float(speeds[1] - speeds[0]) / (2.0 * change)
    pace = float(np.sqrt(stiffness / inertia))
    return pace, 0.5 * yielding * float(np.sqrt(stiffness * inertia)), 0.0


def _inertia(plant: Plant, joint: int) -> float:
    """Inertia of a joint (0-based) in the plant's pose, the others at rest [kg·m²]."""
    model, data = plant.model, mujoco.MjData(plant.model)
    data.qpos[:] = plant.data.qpos
    mujoco.mj_forward(model, data)
    full = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, full)
    place = int(np.flatnonzero(plant.parts.columns == joint)[0])
    return float(full[place, place])
