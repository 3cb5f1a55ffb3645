"""The text of a new project's settings: the whole chain, with starts and priors from the arm and the log."""

import math
from collections.abc import Sequence

import numpy as np

from hydroid.files import Plain, fill_template
from hydroid.project.arm_file import JointSize, flow, rounded
from hydroid.project.layout import Layout
from hydroid.settings.arm import Arm
from hydroid.settings.cylinder import LinearActuator

LONGEST_STEP = 0.025  # of MuJoCo [s], in a log of fewer samples
VALVE_STEP = 0.002  # of valves and oil [s]
DEAD = 0.8  # part of the command below which a joint seems to stand that its dead band is
DRAG = 0.02  # part of the torque at the pump's pressure that damping takes at full speed
RESPONSE = 0.1  # of a valve and its oil without any delay [s]


def fit_text(arm: Arm, layout: Layout | None, sizes: Sequence[JointSize], file: str, arm_file: str) -> str:
    """Return the settings of a fit of the whole chain.

    `file` is their own name as a command takes it, and `arm_file` that of the arm as they name it.
    """
    joints, volumes = list[Plain](), list[float]()
    outputs = range(1, len(arm.joints) + 1) if layout is None else layout.outputs
    flows = {joint: 0.06 * sizes[joint - 1].displacement * sizes[joint - 1].speed for joint in outputs}
    middle = np.median([*flows.values()])
    for joint in outputs:
        name, size, own = arm.joint_names[joint - 1], sizes[joint - 1], arm.joints[joint - 1]
        motion = layout.motions.get(joint) if layout else None
        linear = isinstance(own.actuator, LinearActuator)
        if not linear:
            volumes.append(size.displacement * math.radians(own.range[1] - own.range[0]) / 2)
        joints.append(
            {
                "own": name.removesuffix("_joint"),
                "name": name,
                "linear": linear,
                "damping": short(DRAG * size.damping),
                "delay": min(max(motion.likely_lag - RESPONSE, 0.0), 0.9) if motion else 0.0,
                "unit": "N·s/m" if own.slides else "N·m·s/rad",
                # a stand-in's size is a guess, but the valves of one machine let like flows through
                "draw": 1 if linear else short(middle / flows[joint]),
                "dead": short(DEAD * min(max(motion.dead_band, 5.0), 40.0) if motion else 10.0),
            }
        )
    period = 0.01 if layout is None else float(layout.section["period_s"])
    steps = math.ceil(period / LONGEST_STEP - 1e-9)
    return fill_template(
        "project/fit.yaml.j2",
        file=file,
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
