"""The text of an arm's file: an imported arm, or a template to be filled in."""

from collections.abc import Iterable, Sequence
from typing import Any

from hydroid.cad import ImportedArm, ImportedJoint, ImportedLink
from hydroid.project.sizes import LIFT, JointSize

MESHES = "links"
"""folder of the meshes that an import writes"""

HEAD = """\
# {title}
#
# After a change here: hydroid build-model --arm {file}
#
# Lengths in m, angles in deg. Every frame has its origin in the link's joint and is parallel to the world's
# when all joints are at 0. Each link hangs on the one before it (the first on the base) by the joint of the
# same position.
"""
FRAMES = """\
# The turns of the CAD file's own frames are in the meshes, centres, inertias and axes: a point here is the
# point that you measure in the assembled arm, from the link's joint.
"""
LINKS = """
# mass [kg]; inertia: centre of mass [m], and tensor about it: xx, yy, zz, xy, xz, yz [kg·m²]. Both scale
# with the mass that a fit estimates. Without `inertia`, that of the closed mesh or of the shape counts, at
# uniform density.
links:
"""
JOINTS = """
# axis in the frame of the link before, at its position there [m], range [deg]. Positive angles turn about
# the axis as a right-handed screw does: compare them with your log.
#
# ACTUATORS ARE STAND-INS: each is sized to lift the arm {lift:g} times at 150 bar, at the speed of the log.
# Angles can be predicted with them. Pressures and forces need your cylinders: give their two pivots, as CAD
# shows them with all joints at 0:
#   actuator: {{kind: linear, pivots: {{parent: [x, y, z], child: [x, y, z], frame: arm}},
#              area_a: 3117, area_b: 2099, max_opening: 2}}
# area_a [mm²] pushes the rod out (bore 63 mm: 3117), area_b is what the rod (36 mm) leaves; max_opening
# [mm²] is the valve's at full command: your best guess. `frame: link` takes each point in the frame of its
# own link. `stroke` [mm] is by default what the range takes.
joints:
"""
TEMPLATE = """\
# Lengths in m, angles in deg. Every frame has its origin in the link's joint and is parallel to the world's
# when all joints are at 0. Each link hangs on the one before it (the first on the base) by the joint of the
# same position. A boom and a stick of boxes: put your sizes in, add or remove links and joints. THE NUMBERS
# ARE NO MACHINE'S.
#
# After a change here: hydroid build-model --arm {file}
name: my_arm
model: arm.xml                     # written by `hydroid build-model`
base: {{at: [0, 0, 1]}}              # where the first link's joint hangs, with `at` of that joint

# A link looks like a box, a round bar ({{kind: cylinder, ends: [[x, y, z], [x, y, z]], radius: 0.1}}) or an
# STL file (mesh: boom.stl in place of shape, in a folder `meshes`, in m, with its origin in the link's
# joint). mass [kg].
links:
  - {{name: boom, shape: {{kind: box, size: [3, 0.25, 0.4], at: [1.5, 0, 0]}}, mass: 400}}
  - {{name: stick, shape: {{kind: box, size: [2, 0.2, 0.3], at: [1, 0, 0]}}, mass: 200}}

# axis in the frame of the link before, at its position there [m], range [deg]. About [0, -1, 0] positive
# angles lift. A cylinder is pinned at two points; `frame: arm` are points in the world with all joints at 0
# (`frame: link`: each in the frame of its own link). area_a [mm²] pushes the rod out, area_b is what the
# rod leaves; max_opening [mm²] is the valve's at full command. `stroke` [mm] is by default what the range
# takes.
joints:
  - name: boom
    axis: [0, -1, 0]
    at: [0, 0, 0]
    range: [-30, 60]
    actuator: {{kind: linear, pivots: {{parent: [0.4, 0, 0.3], child: [1.2, 0, 0.9], frame: arm}},
               area_a: 7854, area_b: 4000, max_opening: 20}}
  - name: stick
    axis: [0, -1, 0]
    at: [3, 0, 0]
    range: [-130, -20]
    actuator: {{kind: linear, pivots: {{parent: [1.2, 0, 1.3], child: [2.7, 0, 1.3], frame: arm}},
               area_a: 7854, area_b: 4000, max_opening: 20}}

poses:
  home: [0, -60]                   # where joints stand that a log does not measure
"""


def template_text(file: str) -> str:
    """Return an arm's file of boxes that a reader changes; `file` is its name as a command takes it."""
    return TEMPLATE.format(file=file)


def arm_text(arm: ImportedArm, sizes: Sequence[JointSize], title: str, file: str) -> str:
    """Return the arm's file of an import, with an actuator of the given size for each joint.

    Without sizes no joint has an actuator. `title` says where the arm came from.
    """
    base = ["mesh: base.stl"] if arm.base is not None else []
    pose = [0.0 if j.range[0] <= 0 <= j.range[1] else min(j.range, key=abs) for j in arm.joints]
    lines = [
        HEAD.format(title=title, file=file) + FRAMES + "".join(f"# - {note}\n" for note in arm.notes),
        f"name: {arm.name}\nmodel: arm.xml\nmeshes: {MESHES}\n",
        f"base: {{{', '.join(base)}}}\n",
        LINKS,
        *(_link(link) for link in arm.links),
        JOINTS.format(lift=LIFT),
        *(_joint(joint, sizes[k] if sizes else None) for k, joint in enumerate(arm.joints)),
        f"\n# named poses, an angle per joint; home is where joints stand that a log does not measure\n"
        f"poses:\n  home: {flow(pose)}\n",
    ]
    return "".join(lines)


def _link(link: ImportedLink) -> str:
    t = link.tensor
    tensor = [t[0, 0], t[1, 1], t[2, 2], t[0, 1], t[0, 2], t[1, 2]]
    more = "" if len(link.bodies) == 1 else f"      # with {', '.join(link.bodies[1:])}"
    mesh = f"    mesh: {link.name}.stl\n" if link.mesh is not None else ""
    inertia = f"{{centre: {flow(link.centre)}, tensor: {flow(tensor)}}}"
    return f"  - name: {link.name}{more}\n{mesh}    mass: {number(link.mass)}\n    inertia: {inertia}\n"


def _joint(joint: ImportedJoint, size: JointSize | None) -> str:
    text = f"  - name: {joint.name}\n    axis: {flow(joint.axis)}\n    at: {flow(joint.at)}\n"
    text += f"    range: {flow(joint.range)}\n" + ("    continuous: true\n" if joint.continuous else "")
    if size is None:
        return text
    sizes = f"displacement: {size.displacement:.3g}, max_opening: {size.opening:.3g}"
    return f"{text}    actuator: {{kind: rotary, {sizes}}}      # a stand-in: cm³/rad and mm²\n"


def flow(values: Iterable[float]) -> str:
    """Write numbers as a list."""
    return f"[{', '.join(map(number, values))}]"


def number(value: Any) -> str:
    """Write a number with nine digits at most, and what is 0 but for rounding as 0."""
    return f"{0.0 if abs(value) < 1e-12 else float(value):.9g}"
