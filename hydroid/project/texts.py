"""The texts of a project: the arm's file of an import,
and the settings of a fit of the whole chain.

These have starts and priors from the arm and the log.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import mujoco
import numpy as np

from hydroid.arm.model import load_model
from hydroid.arrays import Array
from hydroid.cad.importer import ImportedArm
from hydroid.files import Plain, fill_template, yaml_text
from hydroid.fitting.valve_start import EXPONENT, LAG_BESIDE_DELAY, JointStart
from hydroid.hydraulics.valve import DENSITY
from hydroid.log import JointMotion
from hydroid.project.layout import Layout
from hydroid.settings.arm import Arm, Joint
from hydroid.settings.cylinder import LinearActuator
from hydroid.settings.hydraulics import HydraulicSettings

LONGEST_STEP = 0.025  # of MuJoCo [s], in a log of fewer samples
VALVE_STEP = 0.002  # of valves and oil [s]
# part of the command below which a joint seems to stand that its dead band is
DEAD = 0.8
UNKNOWN_DEAD = 10.0  # dead band of a joint that no log moves [%]
MOST_DEAD = 85.0  # the largest dead band to start at [%]
UNKNOWN_LAG = 0.05  # of the opening of a joint that no log moves [s]
LONGEST_START_DELAY = 0.9  # to start at [s]
LONGEST_LAG = 0.5  # to start at [s]
# part of the torque at the pump's pressure that damping takes at full speed
DRAG = 0.02
# part of that torque that dry friction takes: it shows where a pump's pressure falls
FRICTION = 0.1
USUAL_SPEED = 0.5  # of a joint of which no log tells its own [rad/s, m/s]
# torque of a joint at the pump's pressure, over the largest that gravity asks of it
LIFT = 2.0
TURNING = {"damping": "N·m·s/rad", "friction": "N·m"}
SLIDING = {"damping": "N·s/m", "friction": "N"}


class JointSize(NamedTuple):
    """What a joint needs: oil [cm³/rad], valve opening [mm²] and damping [N·m·s/rad] at
    a speed [rad/s].

    Of a joint that slides [mm², mm², N·s/m, m/s].
    `area` is the one that pushes its cylinder's rod out [mm²].
    """

    displacement: float
    opening: float
    damping: float
    speed: float
    area: float


def joint_sizes(arm: Arm, speeds: Mapping[int, float]) -> tuple[JointSize, ...]:
    """Return the size of what moves every joint, (J,): starts and centres of wide
    priors, not estimates.

    The displacement gives the torque at the pump's pressure; the opening gives the
    speed while the arm is lifted, and both edges lose the same; the damping holds the
    speed at full command. `speeds` are those that a log shows, by number of the joint
    [rad/s, m/s]; USUAL_SPEED for the others.
    """
    pressure = 1e5 * HydraulicSettings().supply_pressure
    sizes = list[JointSize]()
    for number, (joint, torque) in enumerate(
        zip(arm.joints, _torques(arm).tolist(), strict=True), 1
    ):
        speed = max(speeds.get(number, USUAL_SPEED), 0.01)
        displacement = 1e6 * torque / pressure
        sizes.append(
            JointSize(
                displacement=displacement,
                opening=opening_at(displacement, speed),
                damping=torque / speed,
                speed=speed,
                area=displacement / _lever(joint),
            )
        )
    return tuple(sizes)


def _torques(arm: Arm) -> Array:
    """Return the largest torque that each joint needs in random poses [N·m, N], shape
    (J,)."""
    model = load_model(arm).compile()
    data = mujoco.MjData(model)
    low, high = arm.limits.T
    torque = np.zeros(len(arm.joints))
    # the same poses every time: a project is written twice with the same bytes
    for pose in np.random.default_rng(0).uniform(low, high, (300, len(low))):
        data.qpos[:] = pose
        mujoco.mj_forward(model, data)
        inertia = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, inertia)
        # a joint without weight must give 1 rad/s² at least
        wanted = np.maximum(LIFT * abs(data.qfrc_bias), np.diag(inertia))
        torque = np.maximum(torque, wanted)
    return torque


def opening_at(displacement: float, speed: float) -> float:
    """Return the valve's opening [mm²] that lets a joint of a displacement [cm³/rad]
    move at a speed [rad/s].

    Of a joint that slides [mm², m/s].
    """
    settings = HydraulicSettings()
    pressure = 1e5 * settings.supply_pressure
    # [m/s]
    through = settings.flow_coefficient * np.sqrt((1 - 1 / LIFT) * pressure / DENSITY)
    return displacement * speed / through


def _lever(joint: Joint) -> float:
    """Return the mean moment arm of a joint's cylinder [m]; 1 of other actuators."""
    if not isinstance(joint.actuator, LinearActuator):
        return 1.0
    return np.abs(joint.actuator.moment_arm(np.linspace(*joint.limits, 50))).mean()


def _opening(joint: Joint, speed: float, usual: float) -> str:
    """Return the nominal opening of a direction of a stand-in, from its speed at full
    command, as YAML.

    Empty where the arm's file has an opening that no `usual` speed of the joint gives:
    it holds.
    """
    actuator = joint.actuator
    if actuator is None:
        return ""
    if isinstance(actuator, LinearActuator):
        displacement = actuator.settings.area_a * _lever(joint)
        opening = actuator.settings.max_opening
    else:
        displacement = actuator.displacement
        opening = actuator.max_opening
    sized = [opening_at(displacement, one) for one in (USUAL_SPEED, usual)]
    if not any(math.isclose(opening, one, rel_tol=0.01) for one in sized):
        return ""
    return f"nominal: {short(opening_at(displacement, speed))}, "


class ValveSide(NamedTuple):
    """What the settings say of one direction of a joint's valve: numbers as YAML.

    `one_size`: of a valve that is open or shut, whose logs tell no curve.
    """

    name: str
    opening: str
    dead: str
    exponent: str
    one_size: bool


def _sides(
    joint: Joint, valve: JointStart | None, motion: JointMotion | None, usual: float
) -> list[ValveSide]:
    """Return both directions of a joint's valve, A first, at the speeds that the logs
    show.

    `usual` is the speed of the joint at full command, by which its actuator was sized
    [rad/s].
    """
    if valve is None:
        dead = UNKNOWN_DEAD
        if motion:
            dead = DEAD * min(max(motion.dead_band, 5.0), 40.0)
        opening = ""
        if motion:
            opening = _opening(joint, usual, usual)
        numbers = opening, short(dead), short(EXPONENT)
        return [
            ValveSide("A", *numbers, one_size=False),
            ValveSide("B", *numbers, one_size=False),
        ]
    sides = list[ValveSide]()
    for name, start in zip("AB", valve.sides, strict=True):
        opening = _opening(joint, start.speed, usual)
        # a search ends beside 0, not at it
        band = short(round(min(start.dead_band, MOST_DEAD), 2))
        sides.append(
            ValveSide(name, opening, band, short(start.exponent), start.one_size)
        )
    return sides


def arm_text(imported: ImportedArm, arm: Arm | None, sizes: Sequence[JointSize]) -> str:
    """Return the arm's file of an import, with an actuator of each joint of sizes,
    (J,).

    `arm` is what an earlier text of it says; None: this is that text, and cylinders
    have a size that nothing uses.
    """
    actuators = dict[str, Plain]()
    if arm is None:
        unused = {"area_a": 1000, "area_b": 600, "max_opening": 1}
        for name, cylinder in imported.cylinders.items():
            actuators[name] = cylinder | unused
    else:
        for joint, size in zip(arm.joints, sizes, strict=True):
            sliding = None
            if joint.slides:
                sliding = {"kind": "linear"}
            cylinder = imported.cylinders.get(joint.name, sliding)
            actuators[joint.name] = _actuator(cylinder, size)
    return fill_template(
        "project/arm.yaml.j2",
        title=imported.title,
        notes=imported.notes,
        lift=LIFT,
        actuators=actuators,
        flow=flow,
    )


def _actuator(cylinder: Plain | None, size: JointSize) -> Plain:
    """Return the settings of an actuator of a size: of a cylinder, or of a stand-in for
    one."""
    opening = {"max_opening": rounded(size.opening)}
    if cylinder is None:
        return {"kind": "rotary", "displacement": rounded(size.displacement)} | opening
    # the rod leaves about 65 % of the area
    areas = {"area_a": rounded(size.area), "area_b": rounded(0.65 * size.area)}
    return cylinder | areas | opening


def flow(value: Any) -> str:
    """Write a value as YAML, on one line."""
    return (
        yaml_text(value, default_flow_style=True, width=10_000)
        .removesuffix("...\n")
        .strip()
    )


def rounded(value: float) -> float:
    """Return three digits of a number."""
    return float(f"{value:.3g}")


def fit_text(
    arm: Arm,
    layout: Layout,
    sizes: Sequence[JointSize],
    file: str,
    arm_file: str,
    again: str = "",
) -> str:
    """Return the settings of a fit of the whole chain.

    `file` is their own name as a command takes it, and `arm_file` that of the arm as
    they name it; `again` is the command that goes on once the columns are named.
    """
    flows = dict[int, float]()  # at full speed, by joint [L/min]
    for joint in layout.outputs:
        size = sizes[joint - 1]
        flows[joint] = 0.06 * size.displacement * size.speed
    usual_flow = np.median([*flows.values()])
    drawn = 0.0  # from the pump by all of them [L/min]
    joints = list[Plain]()
    volumes = list[float]()  # of the chambers of stand-ins [cm³]
    for number in layout.outputs:
        joint = arm.joint(number)
        size = sizes[number - 1]
        # a stand-in's size is a guess, but the valves of one machine let like flows
        # through
        stand_in = not isinstance(joint.actuator, LinearActuator)
        draw = 1.0
        if stand_in:
            draw = usual_flow / flows[number]
        drawn += draw * flows[number]
        if stand_in:
            low, high = joint.range
            volumes.append(size.displacement * math.radians(high - low) / 2)
        valve = layout.valves.get(number)
        joints.append(_joint_text(joint, size, layout.motions.get(number), valve, draw))
    period = layout.section.get("period_s", 0.01)
    # a whole number of steps, but for the rounding of the division
    steps = math.ceil(period / LONGEST_STEP - 1e-9)
    return fill_template(
        "project/fit.yaml.j2",
        file=file,
        again=again,
        arm=flow(arm_file),
        outputs=flow([joint["name"] for joint in joints]),
        layout=layout,
        names=arm.joint_names,
        flow=flow,
        steps=steps,
        substeps=math.ceil(period / steps / VALVE_STEP - 1e-9),
        volume=short(min(volumes, default=50.0)),
        most=short(10 * drawn),  # so large that it hardly matters
        felt=short(4 * drawn),
        joints=joints,
    )


def _joint_text(
    joint: Joint,
    size: JointSize,
    motion: JointMotion | None,
    valve: JointStart | None,
    draw: float,
) -> Plain:
    """Return what the settings of a fit say of a joint, and of its motion and valve
    where a log shows them.

    `draw` is what it takes from the pump, over what its actuator takes in.
    """
    linear = isinstance(joint.actuator, LinearActuator)
    torque = size.damping * size.speed
    delay = 0.0
    lag = UNKNOWN_LAG
    if valve:
        delay = valve.delay
        lag = valve.lag
    elif motion:
        delay = max(motion.likely_lag - LAG_BESIDE_DELAY, 0.0)
    return {
        "own": joint.name.removesuffix("_joint"),
        "name": joint.name,
        "linear": linear,
        "lever": joint.has("lever_slope"),
        "sides": _sides(joint, valve, motion, size.speed),
        # none is claimed; a log whose pump or oil is not modelled yet would bend the
        # valve's curve by what damping there is
        "damping": short(DRAG * size.damping),
        # at least none: on the logarithm of `within`, least squares does not get there,
        # and what is left of the damping bends the valve's curve
        "most_damping": short(10 * DRAG * size.damping),
        "delay": min(delay, LONGEST_START_DELAY),
        "lag": min(lag, LONGEST_LAG),
        "friction": short(FRICTION * torque),
        "most_friction": short(5 * FRICTION * torque),
        "unit": SLIDING if joint.slides else TURNING,
        "draw": short(draw),
    }


def short(value: float) -> str:
    """Write three digits of a number."""
    return f"{rounded(value):g}"
