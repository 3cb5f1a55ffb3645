"""Robots' files that are damaged or hostile: each is refused in one line that names the
place, or said."""

import time
from pathlib import Path

import mujoco
import pytest
import robots
import trimesh
from arms import BOOM, MODELS, write_arm
from robots import LIMIT, compiled, joint, link, write_robot

from hydroid.cad.importer import import_arm
from hydroid.errors import HydroidError, ModelError
from hydroid.robot_xml import COPIES, DEEPEST, read_robot

BAD = {
    "nan_origin": "joint 'stick_joint', origin: xyz=\"nan 0 0\" must be finite numbers",
    "nan_rpy": "joint 'boom_joint', origin: rpy=\"nan 0 0\" must be finite numbers",
    "nan_axis": "joint 'stick_joint', axis: xyz=\"nan 1 0\" must be finite numbers",
    "nan_centre_of_mass": "link 'boom', origin: xyz=\"nan 0 0\" must be finite numbers",
    "inf_origin": "joint 'stick_joint', origin: xyz=\"inf 0 0\" must be finite numbers",
    "limits_reversed": "joint 'boom_joint', limit: lower 1.2 above upper -0.6",
    "duplicate_joint_names": "has two joints 'boom_joint'; rename one",
    "joint_named_null": "joint 'null': settings name joints, and in YAML this word is no text; rename it",
}
"""files of tests/models/bad_arms, and what is said of them"""


def refused(path: Path) -> str:
    """Return the error without the file that it begins with; within seconds."""
    start = time.perf_counter()
    with pytest.raises(ModelError) as caught:
        import_arm(path)
    assert time.perf_counter() - start < 5
    name, _, what = str(caught.value).partition(": ")
    assert name == str(path)
    assert "\n" not in what
    return what


@pytest.mark.parametrize("name", BAD)
def test_a_number_or_name_that_means_nothing_is_refused_where_it_stands(name):
    assert refused(MODELS / "bad_arms" / f"{name}.urdf") == BAD[name]


def chain(links: int) -> str:
    parts = "".join(
        f'<link name="l{k + 1}"/><joint name="j{k}" type="revolute"><parent link="l{k}"/>'
        f'<child link="l{k + 1}"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint>'
        for k in range(links)
    )
    return f'<robot name="c"><link name="l0"/>{parts}</robot>'


LOOP = """<robot name="c"><link name="a"/><link name="b"/>
<joint name="j" type="fixed"><parent link="a"/><child link="b"/></joint>
<joint name="k" type="fixed"><parent link="b"/><child link="a"/></joint></robot>"""
ENDLESS = {
    "chain.urdf": (chain(5000), f"link 'l{DEEPEST + 1}' is carried by more than {DEEPEST} others"),
    "loop.urdf": (LOOP, "link 'b' is carried by itself; correct parents and children"),
    "deep.urdf": ("<a>" * 20_000 + "</a>" * 20_000, f"its elements are nested more than {DEEPEST} deep"),
    "self.xml": ('<mujoco><include file="self.xml"/></mujoco>', "includes self.xml again"),
    "twice.xml": (
        '<mujoco><replicate count="1000"><replicate count="1000"/></replicate></mujoco>',
        f"replicates more than {COPIES} times",
    ),
    "wide.xml": ("<mujoco>" + "<a/>" * 200_001 + "</mujoco>", "holds more than 200000 elements"),
}  # fmt: skip


@pytest.mark.parametrize("name", ENDLESS)
def test_a_file_without_end_is_refused_at_once(tmp_path, name):
    text, what = ENDLESS[name]
    (tmp_path / name).write_text(text)
    assert refused(tmp_path / name).startswith(what)


def test_files_that_include_each_other_twice_are_refused_at_once(tmp_path):
    """25 files that each include the next one twice would be 2^25."""
    for k in range(25):
        twice = 2 * f'<include file="w{k + 1}.xml"/>'
        (tmp_path / f"w{k}.xml").write_text(f"<mujoco>{twice}</mujoco>")
    (tmp_path / "w25.xml").write_text("<mujoco/>")
    start = time.perf_counter()
    with pytest.raises(
        ModelError, match=r"includes w\d+\.xml again; MuJoCo takes a file once"
    ):
        import_arm(tmp_path / "w0.xml")
    assert time.perf_counter() - start < 5


def test_what_is_no_file_is_not_waited_for(tmp_path):
    (tmp_path / "a.xml").write_text(f'<mujoco><include file="{tmp_path}"/></mujoco>')
    with pytest.raises(ModelError, match="is no file"):
        import_arm(tmp_path / "a.xml")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            ("<worldbody>", '<worldbody><body name="x" pos="nan 0 0"/>'),
            "body 'x': pos=\"nan 0 0\" must be finite",
        ),
        (
            ("<worldbody>", '<worldbody><body name="x" gravcomp="1"/>'),
            "'x' has gravcomp",
        ),
        (
            ("<worldbody>", '<option density="1.2"/><worldbody>'),
            "density or viscosity of the air",
        ),
    ],
)
def test_an_arms_own_mjcf_is_held_to_the_same(tmp_path, change, message):
    """MuJoCo takes NaN for what it likes, and hydroid simulates no gravity
    compensation."""
    assert change[0] in BOOM
    with pytest.raises(HydroidError, match=message):
        _ = write_arm(tmp_path, BOOM.replace(*change)).joints


def limits(
    low: object, high: object, kind: str = "revolute", turn: str = "0 -1 0"
) -> str:
    limit = LIMIT.format(low, high)
    return joint(
        "boom_joint", "house", "boom", at="0.5 0 0.3", kind=kind, axis=turn, limit=limit
    )


@pytest.mark.parametrize(
    ("boom", "note"),
    [
        (
            limits(-34, 68),
            "boom_joint: turns by 102 rad within its limits. Are they in deg?",
        ),
        (
            limits(-0.01, 0.02),
            "boom_joint: turns by only 1.7 deg within its limits. Are they in rad?",
        ),
        (
            limits(0, 1400, "prismatic"),
            "boom_joint: moves by 1400 m within its limits. Are they in mm?",
        ),
        (limits("-inf", "inf"), "boom_joint: without limits"),
        (limits(-1e16, 1e16), "boom_joint: without limits"),
    ],
)
def test_limits_of_another_unit_are_doubted(tmp_path, boom, note):
    arm = import_arm(write_robot(tmp_path, boom_joint=boom))
    assert any(line.startswith(note) for line in arm.notes), arm.notes


def test_limits_that_were_written_in_degrees_are_doubted():
    arm = import_arm(MODELS / "bad_arms/limits_in_degrees.urdf")
    note = "boom_joint: turns by 102 rad within its limits. Are they in deg?"
    assert any(line.startswith(note) for line in arm.notes), arm.notes


def test_every_bad_arm_is_in_a_test():
    names = {path.stem for path in (MODELS / "bad_arms").iterdir()}
    assert names == {*BAD, "limits_in_degrees"}


def test_common_limits_are_not_doubted(tmp_path):
    arm = import_arm(write_robot(tmp_path, boom_joint=limits(-6.2832, 6.2832)))
    assert not any("limits" in line for line in arm.notes)


MACHINE = """<mujoco><compiler angle="radian"/>{option}<worldbody><body name="base" gravcomp="1">
<site name="boom_pivot_parent" pos="0.5 0 -0.3"/><body name="boom_link" gravcomp="1">
<joint name="boom_joint" axis="0 -1 0" range="-0.5 {most}"/>
<geom type="box" size="1 .1 .1" pos="1 0 0" mass="60"/><site name="boom_pivot_child" pos="0.9 0 0.1"/>
<body name="bucket" pos="2 0 0">
<joint name="bucket" axis="0 -1 0" range="-2 -.1"/><geom type="box" size=".4 .4 .3" pos=".4 0 0"{mass}/>
</body></body></body></worldbody>{more}</mujoco>"""


def machine(folder: Path, **changes: str) -> Path:
    texts = {"option": "", "most": "1", "mass": ' mass="150"', "more": ""} | changes
    (folder / "m.xml").write_text(MACHINE.format(**texts))
    return folder / "m.xml"


@pytest.mark.parametrize(
    "option",
    ["", '<option gravity="0 0 0"/>', '<option><flag gravity="disable"/></option>'],
)
def test_nothing_carries_the_arm_but_its_actuators(tmp_path, option):
    arm = import_arm(machine(tmp_path, option=option))
    assert any(
        "gravity compensation of the file is left out" in note for note in arm.notes
    )
    assert any("switches gravity off" in note for note in arm.notes) == bool(option)
    model, data = compiled(arm)
    mujoco.mj_forward(model, data)
    assert not data.qfrc_gravcomp.any()
    # stretched out, of what lifts it
    moments = [9.81 * (60 * 1 + 150 * 2.4), 9.81 * 150 * 0.4]
    assert data.qfrc_bias == pytest.approx(moments, rel=1e-6)


def test_sites_of_the_file_give_a_cylinders_pivots(tmp_path):
    arm = import_arm(machine(tmp_path))
    assert arm.cylinders == {"boom_joint": {"kind": "linear"}}
    model, data = compiled(arm)
    mujoco.mj_kinematics(model, data)
    assert data.site("boom_joint_pivot_parent").xpos == pytest.approx([0.5, 0, -0.3])
    assert data.site("boom_joint_pivot_child").xpos == pytest.approx([0.9, 0, 0.1])
    # beyond a dead centre no cylinder moves its joint
    arm = import_arm(machine(tmp_path, most="3"))
    assert arm.cylinders == {}
    assert any(
        note.startswith("boom_joint: the file's cylinder is not taken: ")
        for note in arm.notes
    )


@pytest.mark.parametrize("kind", ["weld", "connect"])
def test_a_constraint_that_is_left_out_is_said(tmp_path, kind):
    place = ' anchor="0 0 0"' if kind == "connect" else ""
    more = f'<equality><{kind} body1="base" body2="bucket"{place}/></equality>'
    arm = import_arm(machine(tmp_path, more=more))
    what = f"base and bucket: a {kind} of the file ties them, which hydroid does not simulate: left out"
    assert what in arm.notes


def test_a_box_around_a_bucket_is_mostly_empty(tmp_path):
    """MuJoCo fills it with water where the file says nothing; 60 kg of boom in 0.08 m³
    are 750 kg/m³."""
    arm = import_arm(machine(tmp_path, mass=""))
    assert compiled(arm)[0].body("bucket").mass[0] == pytest.approx(
        500 * 0.8 * 0.8 * 0.6
    )


def test_a_link_without_a_mass_has_the_density_of_the_files_others(tmp_path):
    boom, stick = link("boom", mass=0.12 * 300), link("stick", mass=0.0)
    model, _ = compiled(
        import_arm(
            write_robot(
                tmp_path, house=link("house", mass=0.48 * 300), boom=boom, stick=stick
            )
        )
    )
    assert model.body("stick").mass[0] == pytest.approx(0.045 * 300)


def test_one_mesh_in_cm_leaves_the_others_in_m(tmp_path):
    mesh = '<mesh filename="../meshes/track.stl"/>'
    track = f'<link name="track"><visual><geometry>{mesh}</geometry></visual></link>'
    path = write_robot(tmp_path, base=track)
    solid = trimesh.creation.box(extents=(250, 150, 50))
    (tmp_path / "digger/meshes/track.stl").write_bytes(solid.export(file_type="stl"))
    arm = import_arm(path)
    assert (
        "mesh track.stl (250 m long): taken to be in cm, by the distances of the joints"
        in arm.notes
    )
    model, _ = compiled(arm)
    longest = {
        model.geom(g).bodyid[0]: 2 * model.geom_aabb[g, 3:].max()
        for g in range(1, model.ngeom)
    }
    assert longest == {
        0: pytest.approx(2.5),
        1: pytest.approx(1.0),
        2: pytest.approx(2.0),
        3: pytest.approx(1.5),
    }


def test_a_mesh_larger_than_any_machine_is_not_shown(tmp_path, recwarn):
    path = write_robot(tmp_path)
    solid = trimesh.creation.box(extents=(1e30, 1e30, 1e30))
    (tmp_path / "digger/meshes/boom.stl").write_bytes(solid.export(file_type="stl"))
    arm = import_arm(path)
    assert "mesh boom.stl: larger than any machine: not shown" in arm.notes
    assert not any("taken to be" in note for note in arm.notes)
    assert not [
        one
        for one in recwarn
        if "numpy" in str(one.filename) or issubclass(one.category, RuntimeWarning)
    ]


@pytest.mark.parametrize(
    "place",
    [
        "file:///home/other/ws/digger/meshes/boom.stl",
        "file://{folder}/digger/me%73hes/boom.stl",
    ],
)
def test_meshes_of_another_machine_are_found_by_the_end_of_their_path(tmp_path, place):
    mesh = place.format(folder=tmp_path)
    assert (
        len(import_arm(write_robot(tmp_path, boom=link("boom", mesh=mesh))).meshes) == 3
    )


def finger(side: str) -> str:
    shape = '<box size="0.1 0.02 0.02"/>'
    return robots.body(side, (0.1, 0.02, 0.02), 1.0, shape) + joint(
        f"{side}_joint", "stick", side, at="1.5 0 0"
    )


@pytest.mark.parametrize(
    "pair", [("finger_a", "finger_b"), ("grip_left", "grip_right"), ("pad_1", "pad_2")]
)
def test_an_arm_does_not_end_at_a_finger_that_the_log_does_not_name(tmp_path, pair):
    path = write_robot(tmp_path, more="".join(map(finger, pair)))
    assert compiled(import_arm(path))[0].njnt == 3
    assert compiled(import_arm(path, tip=pair[1]))[0].njnt == 4


def test_a_claw_that_the_log_names_is_a_joint_of_the_arm(tmp_path):
    path = write_robot(tmp_path, more=finger("claw"))
    assert compiled(import_arm(path))[0].njnt == 3
    assert compiled(import_arm(path, columns=["claw_V"]))[0].njnt == 4


def test_the_anchor_of_a_cylinder_is_no_joint_of_the_arm(tmp_path):
    more = robots.body("boom_anchor", (0.1, 0.1, 0.1), 5.0, '<box size=".1 .1 .1"/>')
    more += joint("boom_anchor_joint", "stick", "boom_anchor", at="1.5 0 0")
    arm = import_arm(write_robot(tmp_path, more=more))
    assert compiled(arm)[0].njnt == 3
    assert any(
        note.startswith("boom_anchor_joint: part of a cylinder") for note in arm.notes
    )


def test_a_good_file_reads_as_before(tmp_path):
    assert read_robot(write_robot(tmp_path)).tag == "robot"
