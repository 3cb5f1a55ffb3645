import copy

import numpy as np
import pytest
import yaml

from hydroid.assets import find_config
from hydroid.errors import SettingsError
from hydroid.settings.arm import Arm, load_arm
from hydroid.settings.load import validate

SHIPPED = yaml.safe_load(find_config("hydrolek").read_text(encoding="utf-8"))


def test_the_shipped_arm_is_the_articles():
    arm = load_arm("hydrolek")
    assert len(arm.joints) == len(arm.links) == 7
    assert arm.masses.sum() == pytest.approx(45.0)
    assert arm.masses[6:].sum() == pytest.approx(2.5)
    np.testing.assert_allclose(np.degrees(arm.pose("study")), [0, 10, -60, 0, 0, 0, 20])


def test_every_pose_lies_between_the_stops():
    arm = load_arm("hydrolek")
    for name in arm.poses:
        assert np.all(arm.pose(name) >= arm.lower)
        assert np.all(arm.pose(name) <= arm.upper)
    assert np.isinf(arm.upper[5])


def test_paths_are_taken_from_the_files_folder(tmp_path):
    text = find_config("hydrolek").read_text(encoding="utf-8")
    (tmp_path / "configs").mkdir()
    (tmp_path / "configs" / "mine.yaml").write_text(text, encoding="utf-8")
    arm = load_arm(tmp_path / "configs" / "mine.yaml")
    assert arm.meshes == (tmp_path / "meshes").resolve()
    assert arm.model == (tmp_path / "models" / "hydrolek.xml").resolve()


def test_an_arm_survives_being_written_down():
    arm = load_arm("hydrolek")
    assert Arm.model_validate(arm.model_dump(mode="json")) == arm


def test_an_unknown_pose_is_answered_with_the_known_ones():
    with pytest.raises(SettingsError, match=r"no pose 'stduy'.*home, study, rig"):
        load_arm("hydrolek").pose("stduy")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda v: v["joints"].pop(), "7 links need as many joints, not 6"),
        (lambda v: v["joints"][1].update(name="elbow"), "two joints are named elbow"),
        (lambda v: v["links"][1].update(name="base"), "two links are named base"),
        (lambda v: v["links"][2].update(mass=0), r"links\.2\.mass"),
        (lambda v: v["joints"][1].update(range=[90, -30]), "lower < upper"),
        (lambda v: v["joints"][1].update(range=[-80, 90]), "no moment arm at 0 and 180"),
        (lambda v: v["joints"][1].update(continuous=True), "needs a rotary actuator"),
        (lambda v: v["joints"][1]["actuator"].update(stroke=100), "which needs 132.0 mm"),
        (lambda v: v["joints"][1]["actuator"].update(towards=[0, 2, 0]), "along the joint's axis"),
        (lambda v: v["joints"][1].update(axis=[0, 0, 0]), "cannot be"),
        (lambda v: v["joints"][1]["actuator"].update(kind="hydraulic"), "kind"),
        (lambda v: v["fixed"][0].update(carried_by="link9"), "'link9', which is not one of"),
        (lambda v: v["poses"].update(high=[0, 100, 0, 0, 0, 0, 0]), "shoulder at 100 deg is outside"),
        (lambda v: v["poses"].update(short=[0, 0]), "needs 7 angles"),
    ],
)
def test_what_cannot_be_an_arm_is_refused(change, message):
    values = copy.deepcopy(SHIPPED)
    change(values)
    with pytest.raises(SettingsError, match=message):
        validate(values, Arm, "arm.yaml")
