"""A small URDF arm with STL boxes, as CAD exports one: swing, boom and stick."""

from pathlib import Path

import trimesh

LINK = """
  <link name="{name}">
    <inertial><origin xyz="{centre}"/><mass value="{mass}"/>
      <inertia ixx="{ixx}" iyy="{iyy}" izz="{izz}" ixy="0" ixz="0" iyz="0"/></inertial>
    <visual><geometry><mesh filename="{mesh}"/></geometry></visual>
  </link>"""
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


def link(name: str, mass: float | None = None, mesh: str = "", **changes: object) -> str:
    """A link whose box begins at its joint."""
    length, width, height = SIZES[name]
    m = MASSES[name] if mass is None else mass
    values = {
        "name": name,
        "mass": m,
        "centre": f"{length / 2} 0 0",
        "mesh": mesh or f"package://digger/meshes/{name}.stl",
        "ixx": m * (width**2 + height**2) / 12,
        "iyy": m * (length**2 + height**2) / 12,
        "izz": m * (length**2 + width**2) / 12,
    }
    return LINK.format_map(values | changes)


def joint(name: str, parent: str, child: str, **changes: str) -> str:
    """A hinge about -y, 1 rad to both sides."""
    values = {"name": name, "parent": parent, "child": child, "kind": "revolute", "at": "0 0 0"}
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
    """Write digger/urdf/digger.urdf and its meshes, `scale` times as large; return the URDF."""
    meshes = folder / "digger" / "meshes"
    meshes.mkdir(parents=True, exist_ok=True)
    for name, size in SIZES.items():
        solid = trimesh.creation.box(extents=size)
        solid.apply_translation((size[0] / 2, 0, 0))
        solid.apply_scale(scale)
        (meshes / f"{name}.stl").write_bytes(solid.export(file_type="stl"))
    path = folder / "digger" / "urdf" / "digger.urdf"
    path.parent.mkdir(exist_ok=True)
    path.write_text(f'<robot name="digger">{"".join((PARTS | parts).values())}\n</robot>\n')
    return path
