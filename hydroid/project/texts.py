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
from hydroid.cad.importer import ImportedArm
from hydroid.files import Plain, fill_template, yaml_text
from hydroid.hydraulics.valve import DENSITY
from hydroid.project.layout import Layout
from hydroid.settings.arm import Arm, Joint
from hydroid.settings.cylinder import LinearActuator
from hydroid.settings.hydraulics import HydraulicSettings

LONGEST_STEP = 0.025  # of MuJoCo [s], in a log of fewer samples
VALVE_STEP = 0.002  # of valves and oil [s]
DEAD = 0.8  # part of the command below which a joint seems to stand that its dead band is
DRAG = 0.02  # part of the torque at the pump's pressure that damping takes at full speed
RESPONSE = 0.1  # of a valve and its oil without any delay [s]
USUAL_SPEED = 0.5  # of a joint of which no log tells its own [rad/s, m/s]
LIFT = 2.0  # torque of a joint at the pump's pressure, over the largest that gravity asks of it


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
    """Return the size of what moves every joint, (J,): starts and centres of wide priors,
    not estimates.

    The displacement gives the torque at the pump's pressure; the opening gives the speed while the
    arm is lifted, and both edges lose the same; the damping holds the speed at full command.
    `speeds` are those that a log shows, by number of the joint [rad/s, m/s];
    USUAL_SPEED for the others.
    """
    model = load_model(arm).compile()
    data = mujoco.MjData(model)
    low, high = np.maximum(arm.lower, -np.pi), np.minimum(arm.upper, np.pi)
    torque, settings = np.zeros(len(arm.joints)), HydraulicSettings()
    for pose in np.random.default_rng(0).uniform(low, high, (300, len(low))):
        data.qpos[:] = pose
        mujoco.mj_forward(model, data)
        inertia = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, inertia)
        # a joint without weight must give 1 rad/s² at least
        torque = np.maximum(torque, np.maximum(LIFT * abs(data.qfrc_bias), np.diag(inertia)))
    pressure, sizes = 1e5 * settings.supply_pressure, list[JointSize]()
    for joint, most in enumerate(torque.tolist(), 1):
        speed = max(speeds.get(joint, USUAL_SPEED), 0.01)
        oil, lever = 1e6 * most / pressure, _lever(arm.joints[joint - 1])
        sizes.append(JointSize(oil, opening_at(oil, speed), most / speed, speed, oil / lever))
    return tuple(sizes)


def opening_at(displacement: float, speed: float) -> float:
    """Return the valve's opening [mm²] that lets a joint of a displacement [cm³/rad] move at
    a speed [rad/s].

    Of a joint that slides [mm², m/s].
    """
    settings = HydraulicSettings()
    pressure = 1e5 * settings.supply_pressure
    through = settings.flow_coefficient * np.sqrt((1 - 1 / LIFT) * pressure / DENSITY)  # [m/s]
    return displacement * speed / through


def _lever(joint: Joint) -> float:
    """Return the mean moment arm of a joint's cylinder [m]; 1 of other actuators."""
    if not isinstance(joint.actuator, LinearActuator):
        return 1.0
    return np.abs(joint.actuator.moment_arm(np.linspace(*joint.limits, 50))).mean()


def _opening(joint: Joint, speed: float) -> str:
    """Return the nominal opening of a stand-in that was sized before a log told its joint's speed,
    as YAML.

    Empty where the arm's file has another one: it holds.
    """
    own = joint.actuator
    if own is None:
        return ""
    if isinstance(own, LinearActuator):
        oil, opening = own.settings.area_a * _lever(joint), own.settings.max_opening
    else:
        oil, opening = own.displacement, own.max_opening
    if not math.isclose(opening, opening_at(oil, USUAL_SPEED), rel_tol=0.01):
        return ""
    return f"nominal: {short(opening_at(oil, speed))}, "


def arm_text(imported: ImportedArm, arm: Arm | None, sizes: Sequence[JointSize]) -> str:
    """Return the arm's file of an import, with an actuator of each joint of sizes, (J,).

    `arm` is what an earlier text of it says; None: this is that text, and cylinders have a size
    that nothing uses.
    """
    actuators = dict[str, Plain]()
    if arm is None:
        areas = {"area_a": 1000, "area_b": 600, "max_opening": 1}
        actuators = {name: own | areas for name, own in imported.cylinders.items()}
    for joint, size in zip(arm.joints if arm else (), sizes, strict=True):
        own = imported.cylinders.get(joint.name, {"kind": "linear"} if joint.slides else None)
        oil: Plain = {"kind": "rotary", "displacement": rounded(size.displacement)}
        if own is not None:  # the rod leaves about 65 % of the area
            oil = own | {"area_a": rounded(size.area), "area_b": rounded(0.65 * size.area)}
        actuators[joint.name] = oil | {"max_opening": rounded(size.opening)}
    return fill_template(
        "project/arm.yaml.j2",
        title=imported.title,
        notes=imported.notes,
        lift=LIFT,
        actuators=actuators,
        flow=flow,
    )


def flow(value: Any) -> str:
    """Write a value as YAML, on one line."""
    return yaml_text(value, default_flow_style=True, width=10_000).removesuffix("...\n").strip()


def rounded(value: float) -> float:
    """Return three digits of a number."""
    return float(f"{value:.3g}")


def fit_text(
    arm: Arm, layout: Layout, sizes: Sequence[JointSize], file: str, arm_file: str, again: str = ""
) -> str:
    """Return the settings of a fit of the whole chain.

    `file` is their own name as a command takes it, and `arm_file` that of the arm as they name it;
    `again` is the command that goes on once the columns are named.
    """
    joints, volumes = list[Plain](), list[float]()
    flows = {joint: 0.06 * sizes[joint - 1].displacement * sizes[joint - 1].speed for joint in layout.outputs}
    middle = np.median([*flows.values()])
    for joint in layout.outputs:
        name, size, own = arm.joint_names[joint - 1], sizes[joint - 1], arm.joints[joint - 1]
        motion = layout.motions.get(joint)
        linear = isinstance(own.actuator, LinearActuator)
        if not linear:
            volumes.append(size.displacement * math.radians(own.range[1] - own.range[0]) / 2)
        joints.append(
            {
                "own": name.removesuffix("_joint"),
                "name": name,
                "linear": linear,
                "lever": own.has("lever_slope"),
                "opening": _opening(own, size.speed) if motion else "",
                "damping": short(DRAG * size.damping),
                "delay": min(max(motion.likely_lag - RESPONSE, 0.0), 0.9) if motion else 0.0,
                "unit": "N·s/m" if own.slides else "N·m·s/rad",
                # a stand-in's size is a guess, but the valves of one machine let like flows through
                "draw": 1 if linear else short(middle / flows[joint]),
                "dead": short(DEAD * min(max(motion.dead_band, 5.0), 40.0) if motion else 10.0),
            }
        )
    period = layout.section.get("period_s", 0.01)
    steps = math.ceil(period / LONGEST_STEP - 1e-9)
    return fill_template(
        "project/fit.yaml.j2",
        file=file,
        again=again,
        arm=flow(arm_file),
        outputs=flow([one["name"] for one in joints]),
        layout=layout,
        names=arm.joint_names,
        flow=flow,
        steps=steps,
        substeps=math.ceil(period / steps / VALVE_STEP - 1e-9),
        volume=short(min(volumes, default=50.0)),
        most=short(4 * sum(flows.values())),  # so large that it limits no flow
        joints=joints,
    )


def short(value: float) -> str:
    """Write three digits of a number."""
    return f"{rounded(value):g}"
