"""An arm out of a URDF or MJCF: it moves as MuJoCo's own import does, and every trap is
said in one line."""

import mujoco
import numpy as np
import pytest
import robots
import trimesh
from arms import MODELS, posed
from robots import LIMIT, compiled, joint, link, write_robot

from hydroid.cad.importer import import_arm
from hydroid.cad.source import SHOWN
from hydroid.errors import ModelError


def said(arm, start):
    (line,) = [note for note in arm.notes if note.startswith(start)]
    assert "\n" not in line
    return line


def joints(model):
    return [model.joint(j).name for j in range(model.njnt)]


def extents(model, body):
    """Size of what is seen of a body [m], ascending."""
    geoms = np.flatnonzero(
        (model.geom_bodyid == model.body(body).id) & (model.geom_group == SHOWN)
    )
    return np.sort(2 * model.geom_aabb[geoms.item(), 3:])


def tensor(model, body):
    turn = np.empty(9)
    mujoco.mju_quat2Mat(turn, model.body(body).iquat)
    axes = turn.reshape(3, 3)
    return axes * model.body(body).inertia @ axes.T


def of_box(name, mass):
    square = np.array(robots.SIZES[name]) ** 2
    return np.diag(square.sum() - square) * mass / 12


def test_links_joints_and_inertias_are_those_of_the_file(tmp_path):
    model, _ = compiled(import_arm(write_robot(tmp_path)))
    assert [model.body(b).name for b in range(1, 4)] == ["house", "boom", "stick"]
    assert joints(model) == ["swing_joint", "boom_joint", "stick_joint"]
    for name, size in robots.SIZES.items():
        assert model.body(name).mass[0] == robots.MASSES[name]
        np.testing.assert_allclose(
            model.body(name).ipos, [size[0] / 2, 0, 0], atol=1e-12
        )
        np.testing.assert_allclose(
            tensor(model, name), of_box(name, robots.MASSES[name]), atol=1e-9
        )
        np.testing.assert_allclose(extents(model, name), np.sort(size), rtol=1e-6)
    assert model.jnt_range[1] == pytest.approx([-0.5, 1.2])
    assert model.key("home").qpos == pytest.approx([0, 0, -0.2])


def test_turned_frames_move_as_mujocos_own_import_does(tmp_path):
    """Links whose frames are turned, with a tool fixed to the last one, in every
    pose."""
    inertia = '<inertia ixx="2" iyy="3" izz="4" ixy="0.1" ixz="0" iyz="0.2"/>'
    tool = f'<link name="tool"><inertial><origin xyz="0 0.1 0"/><mass value="30"/>{inertia}</inertial></link>'
    boom = {"at": "0.5 0.1 0.3", "turn": "0.3 -0.2 0.5", "axis": "0.1 -1 0.2"}
    stick = {"at": "2 0 0.1", "turn": "-0.4 0.1 0.2", "axis": "0 0.3 1"}
    changes = {
        "boom_joint": joint("boom_joint", "house", "boom", **boom),
        "stick_joint": joint("stick_joint", "boom", "stick", **stick),
        "more": tool + joint("weld", "stick", "tool", kind="fixed", at="1.5 0 0", turn="1 0 0", limit=""),
    }  # fmt: skip
    path = write_robot(tmp_path, **changes)
    found, _ = compiled(import_arm(path))
    assert found.body("stick").mass[0] == 120.0
    text = path.read_text().replace(
        "package://digger/meshes/", str(tmp_path / "digger/meshes") + "/"
    )
    text = text.replace(
        "</robot>", '<mujoco><compiler strippath="false"/></mujoco></robot>'
    )
    model = mujoco.MjSpec.from_string(text).compile()
    for angles in np.random.default_rng(1).uniform(-1, 1, (5, 3)):
        here, there = posed(found, angles), posed(model, angles)
        for name in ("xanchor", "xaxis", "qfrc_bias", "M"):
            np.testing.assert_allclose(
                getattr(here, name), getattr(there, name), atol=1e-6
            )


FORK = (
    link("stick").replace('"stick"', '"hammer"')
    + robots.PARTS["stick"].replace('"stick"', '"chisel"')
    + joint("hammer_joint", "boom", "hammer", at="1 0 0")
    + joint("chisel_joint", "hammer", "chisel", at="1 0 0")
)
MIMIC = LIMIT.format(-1, 1) + '<mimic joint="boom_joint" multiplier="-1"/>'
NO_LIMITS = "swing_joint: without limits: moving without stops"
TUBE = link("stick", mass=5.0).replace('"stick"', '"boom_tube"') + joint(
    "tube", "house", "boom_tube"
)
ROD = link("stick", mass=5.0).replace('"stick"', '"boom_rod"')


def swing(kind, limit):
    return {
        "swing_joint": joint(
            "swing_joint", "track", "house", kind=kind, axis="0 0 1", limit=limit
        )
    }


def stick(**changes):
    return {"stick_joint": joint("stick_joint", "boom", "stick", **changes)}


def light(name):
    return {name: link(name, mass=0.03)}


TRAPS = [
    ({}, "track: root link, the fixed base: its mass does not matter", [800, 200, 90]),
    (
        stick(limit=MIMIC),
        "stick_joint: following another joint, which hydroid does not model",
        [800, 290],
    ),
    (stick(kind="prismatic"), "track: root link", [800, 200, 90]),
    (
        stick(limit=LIMIT.format(-1, 1) + '<origin xyz="9 0 0"/>'),
        "stick_joint: has another <origin>: the first counts, as in ROS",
        [800, 200, 90],
    ),
    (stick(kind="floating"), "stick: free to float in the file: fixed", [800, 290]),
    (
        stick(kind="planar"),
        "stick_joint: moving in a plane, which hydroid does not model",
        [800, 290],
    ),
    (swing("continuous", ""), NO_LIMITS, [800, 200, 90]),
    (swing("revolute", LIMIT.format(0, 0)), NO_LIMITS, [800, 200, 90]),
    (
        {"boom": link("boom", mesh="package://other/meshes/lost.stl")},
        "mesh package://other/meshes/lost.stl: not found from FOLDER/digger/urdf",
        [800, 200, 90],
    ),
    (
        {"more": FORK},
        "the arm is swing_joint - boom_joint - hammer_joint - chisel_joint (the longest branch); held at 0, "
        "on no way to its end: stick_joint. Other ends: --tip stick",
        [800, 290, 90, 90],
    ),
    (
        {
            "more": TUBE
            + ROD
            + joint("boom_rod_joint", "boom_tube", "boom_rod", kind="prismatic")
        },
        "tube and boom_rod_joint: part of a cylinder that the file pins at one end: held. Give both pivots",
        [810, 200, 90],
    ),
    (
        light("boom") | light("stick"),
        "MASSES THAT NO MACHINE HAS [kg]: boom 0.03 -> 144, stick 0.03 -> 54 (1200 kg/m³ of hull is taken). "
        "Say what you know: --total-mass KG",
        [800, 144, 54],
    ),
    (
        {"boom": link("boom", mass=7.0, mesh="lost.stl")},  # 2 m long
        "MASSES THAT NO MACHINE HAS [kg]: boom 7 -> 144",
        [800, 144, 90],
    ),
]
"""changes of a URDF, the beginning of the note on them, and the masses of the moving
bodies [kg]"""


@pytest.mark.parametrize(
    ("changes", "note", "masses"), TRAPS, ids=[note[:30] for _, note, _ in TRAPS]
)
def test_a_trap_is_said_in_one_line(tmp_path, changes, note, masses):
    arm = import_arm(write_robot(tmp_path, **changes))
    said(arm, note.replace("FOLDER", str(tmp_path)))
    model, _ = compiled(arm)
    assert model.body_mass.tolist() == pytest.approx([0, *masses])
    assert model.jnt_limited.all() == (note != NO_LIMITS)


def test_a_total_mass_scales_all_that_moves(tmp_path):
    model, _ = compiled(
        import_arm(write_robot(tmp_path, **light("boom")), total_mass=5170.0)
    )
    assert model.body_mass[1:] == pytest.approx(np.array([800, 144, 90]) * 5)
    np.testing.assert_allclose(
        tensor(model, "stick"), of_box("stick", 5 * 90), atol=1e-9
    )


@pytest.mark.parametrize(
    "mesh",
    [
        "package://digger/meshes/boom.stl",
        "../meshes/BOOM.stl",
        "package://x/meshes/boom.stl",
    ],
)
def test_meshes_are_found_from_the_urdfs_folder_and_its_parents(tmp_path, mesh):
    path = write_robot(tmp_path, boom=link("boom", mesh=mesh))
    (path.parent / "boom.stl").write_bytes(
        (path.parents[1] / "meshes/boom.stl").read_bytes()
    )
    assert any(name.lower() == "links/boom.stl" for name in import_arm(path).meshes)


MESH = '<mesh filename="../meshes/boom.stl"/>'
NOBODY = "link boom: an inertia that no rigid body has: that of its hull is taken"
FAULTS = {
    "no inertial": (
        f'<link name="boom"><visual><geometry>{MESH}</geometry></visual></link>',
        "MASSES THAT NO MACHINE HAS [kg]: boom none -> 144",
        144.0,
    ),
    "no mass": (
        link("boom", mass=0.0, ixx=1, iyy=1, izz=1),
        "MASSES THAT NO MACHINE HAS",
        144.0,
    ),
    "A + B < C": (link("boom", ixx=1, iyy=1, izz=9), NOBODY, 200.0),
    "no inertia": (link("boom", ixx=0, iyy=0, izz=0), NOBODY, 200.0),
    "negative": (link("boom", ixx=-1, iyy=5, izz=5), NOBODY, 200.0),
    "in kg mm²": (
        link("boom", ixx=2e6, iyy=7e7, izz=7e7),
        "link boom: an inertia of a far larger",
        200.0,
    ),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_an_impossible_inertia_is_that_of_the_mesh(tmp_path, fault):
    text, message, mass = FAULTS[fault]
    arm = import_arm(write_robot(tmp_path, boom=text))
    said(arm, message)
    model, _ = compiled(arm)
    assert model.body("boom").mass[0] == pytest.approx(mass)
    np.testing.assert_allclose(
        tensor(model, "boom"), of_box("boom", mass), rtol=1e-6, atol=1e-6
    )
    np.testing.assert_allclose(model.body("boom").ipos, [1, 0, 0], atol=1e-9)


@pytest.mark.parametrize(("stated", "taken"), [(22.0, 22.0), (10.0, 144.0)])
def test_a_box_around_a_bent_boom_may_weigh_little(tmp_path, stated, taken):
    arm = import_arm(write_robot(tmp_path, boom=link("boom", mass=stated)))
    assert compiled(arm)[0].body("boom").mass[0] == pytest.approx(taken)


def test_meshes_in_millimetres_are_scaled(tmp_path):
    arm = import_arm(write_robot(tmp_path, scale=1000.0))
    said(arm, "meshes up to 2000 m long: all are taken to be in mm")
    model, _ = compiled(arm)
    assert [extents(model, name).max() for name in robots.SIZES] == pytest.approx(
        [1, 2, 1.5]
    )

    # the file's own scale is used
    boom = robots.PARTS["boom"].replace('.stl"', '.stl" scale="0.5 0.5 0.5"')
    arm = import_arm(write_robot(tmp_path, boom=boom))
    assert extents(compiled(arm)[0], "boom").max() == pytest.approx(1.0)


@pytest.mark.parametrize("kind", ["obj", "stl_ascii", "ply"])
def test_other_mesh_files_are_converted(tmp_path, kind):
    box = trimesh.load(
        write_robot(tmp_path).parents[1] / "meshes/boom.stl", force="mesh"
    )
    name = f"boom.{kind.removesuffix('_ascii')}"
    content = box.export(file_type=kind)
    target = tmp_path / "digger/meshes" / name
    target.write_bytes(content if isinstance(content, bytes) else content.encode())
    arm = import_arm(write_robot(tmp_path, boom=link("boom", mesh=f"../meshes/{name}")))
    np.testing.assert_allclose(
        extents(compiled(arm)[0], "boom"), np.sort(robots.SIZES["boom"]), rtol=1e-6
    )


def test_a_mesh_that_cannot_be_read_is_said(tmp_path):
    arm = import_arm(
        write_robot(tmp_path, boom=link("boom", mesh="../meshes/boom.dae"))
    )
    said(arm, "mesh ../meshes/boom.dae: not found")
    (tmp_path / "digger/meshes/boom.dae").write_text("<COLLADA/>")
    arm = import_arm(tmp_path / "digger/urdf/digger.urdf")
    said(arm, "mesh boom.dae: cannot be read; pip install pycollada")
    assert compiled(arm)[0].body("boom").mass[0] == 200.0


def test_the_branch_that_the_log_names_or_that_is_asked_for_is_taken(tmp_path):
    path = write_robot(tmp_path, more=FORK)
    arm = import_arm(path, columns=["t", "u_stick_V", "phi stick"])
    taken = "swing_joint - boom_joint - stick_joint (the log names most of its joints)"
    said(arm, f"the arm is {taken}; held at 0")
    assert joints(compiled(arm)[0]) == ["swing_joint", "boom_joint", "stick_joint"]
    assert compiled(import_arm(path, tip="boom"))[0].njnt == 2
    with pytest.raises(
        ModelError, match=r"no joint moves a link 'bom'; tips: stick, chisel"
    ):
        import_arm(path, tip="bom")


def test_an_mjcf_is_read_too(tmp_path):
    write_robot(tmp_path)
    path = tmp_path / "digger" / "arm.xml"
    path.write_text((MODELS / "arm.xml").read_text())
    arm = import_arm(path)
    assert arm.title == "my_arm, from arm.xml"
    said(arm, "slide_joint: without limits: moving without stops")
    model, data = compiled(arm)
    assert model.body("boom").mass[0] == pytest.approx(0.12 * 500)
    assert model.body("stick").mass[0] == pytest.approx(50)
    assert model.jnt_type.tolist() == [3, 3, 2]
    np.testing.assert_allclose(data.body("boom").xipos, [0.5, 1, 1.6], atol=1e-6)
    np.testing.assert_allclose(
        data.xanchor[:2], [[0.5, 0, 1.6], [0.5, 2, 1.6]], atol=1e-9
    )
    assert np.degrees(model.jnt_range[1]) == pytest.approx([-90, 0])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("<robot", "cannot be read as XML"),
        ("<sdf/>", "is an SDF; convert it: sdformat2mjcf"),
        ("<world/>", "is neither URDF nor MJCF: its root element is <world>"),
        ('<robot xmlns:xacro="http://ros.org/xacro"><xacro:include filename="a"/></robot>', "is a xacro"),
        ('<robot name="a"><link name="b"/></robot>', "has no joint that hydroid could move"),
        ('<robot name="a"><joint name="j" type="revolute"/></robot>', "MuJoCo refuses it"),
        ("PXR-USDC", "is a USD stage; export the arm as URDF"),
    ],
)  # fmt: skip
def test_a_file_that_is_no_arm_is_refused_in_one_line(tmp_path, text, message):
    path = tmp_path / ("arm.usd" if text == "PXR-USDC" else "arm.urdf")
    path.write_text(text)
    with pytest.raises(ModelError, match=message) as caught:
        import_arm(path)
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)
    with pytest.raises(ModelError, match=r"cannot be read as XML .*No such file"):
        import_arm(tmp_path / "none.urdf")
