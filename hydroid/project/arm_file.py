"""The arm's files of a project: those of an imported arm, or a template to be filled in."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import mujoco
import numpy as np
import yaml

from hydroid.arm.model import load_model
from hydroid.cad.importer import SCENE, ImportedArm
from hydroid.files import Plain
from hydroid.hydraulics.valve import DENSITY
from hydroid.settings.arm import Arm
from hydroid.settings.cylinder import LinearActuator
from hydroid.settings.hydraulics import HydraulicSettings

LIFT = 2.0  # torque of a joint at the pump's pressure, over the largest that gravity asks of it


class JointSize(NamedTuple):
    """What a joint needs: oil [cm³/rad], valve opening [mm²] and damping [N·m·s/rad] at a speed [rad/s].

    Of a joint that slides [mm², mm², N·s/m, m/s]. `area` is the one that pushes its cylinder's rod out [mm²];
    0: it has none.
    """

    displacement: float
    opening: float
    damping: float
    speed: float
    area: float = 0.0


def joint_sizes(arm: Arm, speeds: Mapping[int, float]) -> tuple[JointSize, ...]:
    """Return the size of what moves every joint, (J,): starts and centres of wide priors, not estimates.

    The displacement gives the torque at the pump's pressure; the opening gives the speed while the arm is
    lifted, and both edges lose the same; the damping holds the speed at full command.

    Args:
        arm: with its model in place.
        speeds: that a log shows, by number of the joint [rad/s, m/s]; 0.5 for the others.
    Raises ModelError: the arm's model cannot be read.
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
    through = settings.flow_coefficient * np.sqrt((1 - 1 / LIFT) * pressure / DENSITY)  # [m/s]
    for joint, most in enumerate(torque.tolist(), 1):
        speed = max(speeds.get(joint, 0.5), 0.01)
        oil, own, lever = 1e6 * most / pressure, arm.joints[joint - 1], 0.0
        if isinstance(own.actuator, LinearActuator):
            lever = np.abs(own.actuator.moment_arm(np.linspace(*own.limits, 50))).mean()
        sizes.append(
            JointSize(oil, oil * speed / through, most / speed, speed, oil / lever if lever else 0.0)
        )
    return tuple(sizes)


ARM_FILE = """\
# {title}
#
# The model, arm.xml, has links, joints, ranges, masses and meshes: correct them there. Its keyframe `home` is
# where joints stand that a log does not measure. Positive angles turn about a joint's axis as a right-handed
# screw does: compare them with your log.
{notes}model: arm.xml

# ACTUATORS ARE STAND-INS: each is sized to lift the arm {lift:g} times at 150 bar, at the speed of the log.
# Angles can be predicted with them. Pressures and forces need your cylinders: their areas, and where the file
# had none their two pivots [m], as CAD shows them with all joints at 0. One along a slide needs no pivots:
#   JOINT: {{kind: linear, pivots: {{parent: [x, y, z], child: [x, y, z]}},
#           area_a: 3117, area_b: 2099, max_opening: 2}}
# area_a [mm²] pushes the rod out (bore 63 mm: 3117), area_b is what the rod (36 mm) leaves; max_opening [mm²]
# is the valve's at full command: your best guess. `stroke` [mm] is by default what the range takes.
actuators:
{actuators}
"""
TEMPLATE_FILE = """\
# A boom and a stick. THE NUMBERS ARE NO MACHINE'S. The model, arm.xml, has links, joints, ranges and masses.
model: arm.xml

# A cylinder is pinned at two points of the assembled arm, with all joints at 0 [m]. area_a [mm²] pushes the
# rod out, area_b is what the rod leaves; max_opening [mm²] is the valve's at full command. `stroke` [mm] is
# by default what the range takes.
actuators:
  boom: {kind: linear, pivots: {parent: [0.4, 0, 0.3], child: [1.2, 0, 0.9]},
         area_a: 7854, area_b: 4000, max_opening: 20}
  stick: {kind: linear, pivots: {parent: [1.2, 0, 1.3], child: [2.7, 0, 1.3]},
          area_a: 7854, area_b: 4000, max_opening: 20}
"""
TEMPLATE_MODEL = f"""\
<!-- A boom and a stick of boxes: put your sizes in, add or remove links and joints. THE NUMBERS ARE NO
     MACHINE'S. MuJoCo's XML: lengths in m, angles in degrees; a box has half its lengths in `size`; `mass` is
     a link's in kg. About the axis 0 -1 0 positive angles lift. A mesh:
     <asset><mesh name="boom" file="boom.stl" inertia="exact"/></asset> and
     <geom type="mesh" mesh="boom" mass="400"/>. -->
<mujoco model="my_arm">
{SCENE}
  <asset>
    <material name="paint" rgba="0.94 0.53 0.08 1" specular="0.35" shininess="0.35"/>
  </asset>
  <statistic center="2 0 1" extent="4"/>
  <worldbody>
    <body name="base" pos="0 0 1">
      <body name="boom">
        <joint name="boom" axis="0 -1 0" range="-30 60"/>
        <geom type="box" size="1.5 0.125 0.2" pos="1.5 0 0" mass="400" group="2" material="paint"/>
        <body name="stick" pos="3 0 0">
          <joint name="stick" axis="0 -1 0" range="-130 -20"/>
          <geom type="box" size="1 0.1 0.15" pos="1 0 0" mass="200" group="2" material="paint"/>
        </body>
      </body>
    </body>
  </worldbody>
  <keyframe>
    <!-- where joints stand that a log does not measure [rad] -->
    <key name="home" qpos="0 -1.0472"/>
  </keyframe>
</mujoco>
"""


def arm_text(imported: ImportedArm, arm: Arm | None, sizes: Sequence[JointSize], title: str) -> str:
    """Return the arm's file of an import, with an actuator of each joint of sizes, (J,).

    `arm` is what an earlier text of it says; None: this is that text, and cylinders have a size that nothing
    uses. `title` says where the arm came from.
    """
    actuators = dict[str, Plain]()
    if arm is None:
        areas = {"area_a": 1000, "area_b": 600, "max_opening": 1}
        actuators = {name: own | areas for name, own in imported.cylinders.items()}
    for joint, size in zip(arm.joints if arm else (), sizes, strict=True):
        own = imported.cylinders.get(joint.name, {"kind": "linear"} if joint.slides else None)
        area = size.area or size.displacement
        oil: Plain = {"kind": "rotary", "displacement": rounded(size.displacement)}
        if own is not None:  # the rod leaves about 65 % of the area
            oil = own | {"area_a": rounded(area), "area_b": rounded(0.65 * area)}
        actuators[joint.name] = oil | {"max_opening": rounded(size.opening)}
    flow: Plain = {"default_flow_style": True, "sort_keys": False, "width": 1e9}
    lines = [f"  {name}: {yaml.safe_dump(own, **flow).strip()}" for name, own in actuators.items()]
    notes = "".join(f"# - {note}\n" for note in imported.notes)
    return ARM_FILE.format(title=title, notes=notes, lift=LIFT, actuators="\n".join(lines) or "  {}")


def rounded(value: float) -> float:
    """Return three digits of a number."""
    return float(f"{value:.3g}")
