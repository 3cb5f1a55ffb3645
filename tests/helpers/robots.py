"""URDFs of boxes, as CAD exports them; and a small one with STL meshes: swing, boom and
stick."""

from pathlib import Path

import mujoco
import trimesh
from arms import posed

from hydroid.cad.importer import ImportedArm

INERTIAL = """
    <inertial><origin xyz="{centre}"/><mass value="{mass}"/>
      <inertia ixx="{ixx}" iyy="{iyy}" izz="{izz}" ixy="0" ixz="0" iyz="0"/></inertial>"""
JOINT = """
  <joint name="{name}" type="{kind}">
    <parent link="{parent}"/><child link="{child}"/><origin xyz="{at}" rpy="{turn}"/><axis xyz="{axis}"/>
    {limit}
  </joint>"""
LIMIT = '<limit lower="{}" upper="{}" effort="1e5" velocity="1"/>'
WIDE = LIMIT.format(-3, 3)
SIZES = {"house": (1.0, 0.8, 0.6), "boom": (2.0, 0.2, 0.3), "stick": (1.5, 0.15, 0.2)}
"""length, width and height of the links' boxes [m]"""
MASSES = {"house": 800.0, "boom": 200.0, "stick": 90.0}


def body(
    name: str,
    size: tuple[float, float, float],
    mass: float | None,
    shape: str,
    **changes: object,
) -> str:
    """A link whose box of a size [m] and mass [kg] begins at its joint; without a mass:
    no inertia."""
    m, (x, y, z) = mass or 0.0, (length**2 / 12 for length in size)
    values = {"mass": m, "centre": f"{size[0] / 2} 0 0", "seen": "0 0 0"}
    values |= {"ixx": m * (y + z), "iyy": m * (x + z), "izz": m * (x + y)} | changes
    inertial = "" if mass is None else INERTIAL.format_map(values)
    visual = (
        f'<visual><origin xyz="{values["seen"]}"/><geometry>{shape}</geometry></visual>'
    )
    return f'\n  <link name="{name}">{inertial}\n    {visual}\n  </link>'


def link(
    name: str, mass: float | None = None, mesh: str = "", **changes: object
) -> str:
    shape = f'<mesh filename="{mesh or f"package://digger/meshes/{name}.stl"}"/>'
    return body(
        name, SIZES[name], MASSES[name] if mass is None else mass, shape, **changes
    )


def joint(name: str, parent: str, child: str, **changes: str) -> str:
    """A hinge about -y, 1 rad to both sides."""
    values = {
        "name": name,
        "parent": parent,
        "child": child,
        "kind": "revolute",
        "at": "0 0 0",
    }
    values |= {"turn": "0 0 0", "axis": "0 -1 0", "limit": LIMIT.format(-1, 1)}
    return JOINT.format_map(values | changes)


PARTS = {
    "base": '\n  <link name="track"><visual><geometry><box size="2 1.5 0.5"/></geometry></visual></link>',
    "house": link("house"),
    "boom": link("boom"),
    "stick": link("stick"),
    "swing_joint": joint("swing_joint", "track", "house", at="0 0 0.8", axis="0 0 1", limit=WIDE),
    "boom_joint": joint("boom_joint", "house", "boom", at="0.5 0 0.3", limit=LIMIT.format(-0.5, 1.2)),
    "stick_joint": joint("stick_joint", "boom", "stick", at="2 0 0", limit=LIMIT.format(-2.2, -0.2)),
    "more": "",
}  # fmt: skip
"""the file by its parts, which tests replace"""


def write_robot(folder: Path, scale: float = 1.0, **parts: str) -> Path:
    """Write digger/urdf/digger.urdf and its meshes, `scale` times as large; return the
    URDF."""
    meshes = folder / "digger" / "meshes"
    meshes.mkdir(parents=True, exist_ok=True)
    for name, size in SIZES.items():
        solid = trimesh.creation.box(extents=size)
        solid.apply_translation((size[0] / 2, 0, 0))
        solid.apply_scale(scale)
        (meshes / f"{name}.stl").write_bytes(solid.export(file_type="stl"))
    path = folder / "digger" / "urdf" / "digger.urdf"
    path.parent.mkdir(exist_ok=True)
    path.write_text(
        f'<robot name="digger">{"".join((PARTS | parts).values())}\n</robot>\n'
    )
    return path


def compiled(arm: ImportedArm) -> tuple[mujoco.MjModel, mujoco.MjData]:
    model = mujoco.MjSpec.from_string(arm.mjcf, assets=arm.meshes).compile()
    return model, posed(model, 0.0)
