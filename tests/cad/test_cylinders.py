"""Cylinders that an MJCF models as loops of links: pivots, linkages and limits against
stated truth."""

import numpy as np
import pytest
from arms import MODELS
from robots import compiled
from scipy.optimize import least_squares

from hydroid.cad.importer import import_arm
from hydroid.settings.cylinder import LinearActuator, make_cylinder
from hydroid.settings.linkage import Cylinder

FOOT, EYE = np.array([0.5, -0.3]), np.array([1.4, 0.35])
"""of the boom's cylinder, on the house and on the boom, seen from the boom's joint
[m]"""
GROUND, PIN, CHILD = np.array([1.6, 0.15]), np.array([1.75, 0.5]), np.array([2.12, 0.3])
"""of the bucket's rocker on the stick, of rocker and coupler, of coupler and bucket, in
the stick's frame"""
TAIL, BUCKET = np.array([0.3, 0.45]), np.array([2.0, 0.0])
"""of the bucket's cylinder on the stick; the bucket's joint"""


LINKAGE = """<mujoco model="linkage"><worldbody><body name="house">
  <geom type="box" size=".2 .2 .2" mass="50"/>
  <body name="boom" pos="0 0 .5"><joint name="boom" axis="0 1 0" range="-57 57"/>
    <geom type="box" pos=".5 0 0" size=".5 .1 .1" mass="100"/>{E}{F}{G}
    <body name="bucket" pos="1 0 0"><joint name="bucket" axis="0 1 0" range="-20 20"/>
      <geom type="box" pos=".2 0 0" size=".2 .1 .1" mass="40"/>{H}
  </body></body></body></worldbody></mujoco>"""


def written(folder):
    """The file: rods point from their feet to their eyes, pinned to rocker and coupler
    in one point."""
    way, rod = EYE - FOOT, PIN - TAIL
    path = folder / "loops.xml"
    angles = {
        "boom": -np.arctan2(way[1], way[0]),
        "bucket": -np.arctan2(rod[1], rod[0]),
    }
    text = (MODELS / "loops.xml").read_text()
    path.write_text(text.format(**angles, eye=np.hypot(*way) - 0.3, rod=np.hypot(*rod)))
    return path


@pytest.fixture(scope="module")
def arm(tmp_path_factory):
    return import_arm(written(tmp_path_factory.mktemp("loops")))


def actuator(arm, name) -> LinearActuator:
    model, data = compiled(arm)
    own = Cylinder(**arm.cylinders[name], area_a=1000, area_b=600, max_opening=1)
    return make_cylinder(own, tuple(model.joint(name).range), data, name)


PINS = {"E": (0.2, 0.3), "F": (0.8, 0.3), "G": (0.85, 0.05), "H": (1.1, 0.15)}
"""of a good linkage, in the boom's frame, whose bucket turns at (1, 0) [m]"""


@pytest.mark.parametrize(
    "moved",
    [
        {"G": (1, 0)},
        {"F": PINS["G"]},
        {"F": PINS["H"]},
        {"H": (1, 0)},
        {"E": PINS["G"]},
    ],
    ids=str,
)
def test_a_linkage_whose_pins_coincide_is_left_out_and_named(tmp_path, moved):
    def import_linkage(pins):
        sites = {
            name: f'<site name="{name}" pos="{x - (name == "H")} 0 {z}"/>'
            for name, (x, z) in pins.items()
        }
        path = tmp_path / "linkage.xml"
        path.write_text(LINKAGE.format(**sites))
        return import_arm(path)

    assert "bucket" in import_linkage(PINS).cylinders
    arm = import_linkage(PINS | moved)
    assert arm.cylinders == {}
    said = "bucket: its four-bar linkage does not close, or two of its pins coincide: left out"
    assert said in arm.notes


def test_angles_count_from_the_joints_own_zero(arm, tmp_path):
    path = written(tmp_path)
    text = path.read_text().replace(
        'name="bucket" axis', 'name="bucket" ref="0.3" axis'
    )
    path.write_text(text.replace('name="boom" axis', 'name="boom" ref="-0.2" axis'))
    other = import_arm(path)
    here, there = (actuator(one, "bucket") for one in (arm, other))
    np.testing.assert_allclose(there.length(0.4), here.length(0.1), atol=1e-6)
    np.testing.assert_allclose(there.moment_arm(0.3), here.moment_arm(0.0), atol=1e-6)


def turned(point, angle):
    return (
        np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        @ point
    )


def test_rods_are_no_end_of_the_arm_and_weigh_on_their_links(arm):
    model, _ = compiled(arm)
    assert [model.joint(j).name for j in range(model.njnt)] == [
        "swing",
        "boom",
        "stick",
        "bucket",
    ]
    assert model.body_mass[-4:] == pytest.approx([4080, 800, 450, 310])
    assert set(arm.cylinders) == {"boom", "bucket"}


def test_a_cylinder_between_two_links_has_its_pivots(arm):
    cylinder = actuator(arm, "boom")
    for angle in (-0.1, 0.0, 0.2):
        expected = np.linalg.norm(turned(EYE, angle) - FOOT)
        assert cylinder.length(angle) == pytest.approx(expected, abs=1e-9)


def test_the_cylinder_of_a_joint_without_limits_is_not_taken(tmp_path):
    path = written(tmp_path)
    path.write_text(path.read_text().replace(' range="-.3 .5"', ""))
    arm = import_arm(path)
    assert set(arm.cylinders) == {"bucket"}
    assert (
        "boom: without limits: the file's cylinder that moves it is not taken"
        in arm.notes
    )


def test_a_buckets_linkage_moves_as_its_bars_do(arm):
    cylinder, low, high = actuator(arm, "bucket"), -0.15, 0.15

    def rod_length(angle: float, near: float = 0.0) -> float:
        """Length of the cylinder where rocker and coupler meet, solved numerically."""
        child, coupler = (
            BUCKET + turned(CHILD - BUCKET, angle),
            np.linalg.norm(PIN - CHILD),
        )

        def open_by(turn):
            return (
                np.linalg.norm(GROUND + turned(PIN - GROUND, turn[0]) - child) - coupler
            )

        turn = least_squares(open_by, [angle], xtol=1e-14, ftol=1e-14, gtol=1e-14).x[0]
        return float(np.linalg.norm(GROUND + turned(PIN - GROUND, turn) - TAIL))

    for angle in np.linspace(low, high, 7):
        assert cylinder.length(angle) == pytest.approx(rod_length(angle), abs=1e-5)
    slope = (rod_length(1e-4) - rod_length(-1e-4)) / 2e-4
    assert cylinder.moment_arm(0.0) == pytest.approx(slope, rel=1e-4)
    assert cylinder.sense == np.sign(slope)
