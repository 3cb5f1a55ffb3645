"""An arm of boxes from names and lengths: for a machine of which nobody has CAD."""

from pathlib import Path

import numpy as np
import pytest
from field_logs import Truth, make_truth, text

import hydroid
from hydroid.errors import SettingsError

pytestmark = pytest.mark.usefixtures("no_picture", "short_searches")
EXCAVATOR = {"joints": "swing,boom,arm,bucket", "lengths": "0,3.7,1.6,0.9"}


def test_it_has_these_joints_and_reaches_as_far_as_its_links(tmp_path: Path) -> None:
    hydroid.init(tmp_path / "mine", **EXCAVATOR)
    settings = hydroid.load_settings(tmp_path / "mine" / "fit.yaml")
    arm = settings.arm
    assert arm.joint_names == ("swing", "boom", "arm", "bucket")
    assert np.degrees(arm.ranges["boom"]) == pytest.approx((-30, 60), abs=0.01)
    assert all(mass > 0 for mass in arm.masses)
    plant = hydroid.load_plant(tmp_path / "mine" / "fit.yaml")
    anchors = plant.data.xanchor
    distances = np.linalg.norm(np.diff(anchors, axis=0), axis=1)
    np.testing.assert_allclose(distances, [0, 3.7, 1.6], atol=1e-6)


def test_each_joint_moves_as_it_is_called_and_a_line_says_how(tmp_path: Path) -> None:
    words = {"joints": "slew,boom,telescope", "lengths": "0,3,2"}
    lines = [str(line) for line in hydroid.init(tmp_path / "mine", **words).lines]
    moves = "slew slews, boom lifts and telescope slides by 1.8 m"
    assert any(moves in line for line in lines)
    arm = hydroid.load_settings(tmp_path / "mine" / "fit.yaml").arm
    assert [joint.slides for joint in arm.joints] == [False, False, True]
    assert arm.ranges["telescope"] == pytest.approx((0.0, 1.8))


def test_a_guessed_range_gives_way_to_what_the_logs_reach(tmp_path: Path) -> None:
    truth = make_truth((70, -60, 100, -100))
    path = tmp_path / "log.csv"
    shifted = columns(truth)
    shifted["boom_angle_deg"] = shifted["boom_angle_deg"] + 90
    path.write_text(text(shifted))
    made = hydroid.init(tmp_path / "mine", joints="boom,stick", lengths="3,2", log=path)
    config = tmp_path / "mine" / "fit.yaml"
    low, high = np.degrees(hydroid.load_settings(config).arm.ranges["boom"])
    angles = shifted["boom_angle_deg"]
    assert low < angles.min()
    assert angles.max() < high < 180
    assert any(
        "boom: the range is what the logs reach" in str(line) for line in made.lines
    )
    assert hydroid.check(path, config=config).exit_status == 0


def test_the_total_mass_is_that_of_the_machine(tmp_path: Path) -> None:
    hydroid.init(tmp_path / "mine", **EXCAVATOR, total_mass=2500.0)
    arm = hydroid.load_settings(tmp_path / "mine" / "fit.yaml").arm
    assert arm.masses.sum() == pytest.approx(2500, rel=1e-3)


def test_with_a_log_it_can_be_checked_and_fitted_from(tmp_path: Path) -> None:
    truth = make_truth((70, -60, 100, -100))
    path = tmp_path / "log.csv"
    path.write_text(text(columns(truth)))
    hydroid.init(tmp_path / "mine", joints="boom,stick", lengths="3,2", log=path)
    settings = hydroid.load_settings(tmp_path / "mine" / "fit.yaml")
    assert settings.outputs == (1, 2)
    assert hydroid.check(path, config=tmp_path / "mine" / "fit.yaml").exit_status == 0
    (log,) = hydroid.read_logs(path, settings)
    assert log.driven.all()


def columns(truth: Truth) -> dict[str, np.ndarray]:
    own = {"time_s": truth.time} | {
        f"{name}_cmd_pct": u for name, u in truth.command.items()
    }
    return own | {f"{name}_angle_deg": q for name, q in truth.angle.items()}


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ({"lengths": "0,3.7"}, "2 lengths are given for 4 joints"),
        ({"lengths": "0,3.7,1.6,long"}, "something else than numbers"),
        ({"lengths": "0,3.7,1.6,-1"}, "-1 is no length of a link"),
        ({"lengths": "0,3.7,1.6,nan"}, "nan is no length of a link"),
        ({"lengths": "0,0,0,0"}, "no link has a length"),
        ({"joints": "a,b,b,c"}, "holds a name twice"),
        ({"joints": "a,b,<c,d"}, "no name of a joint"),
        ({"joints": "a,b,Löffel,d"}, "no name of a joint"),
        ({"joints": "telescope,a,b,c"}, "the telescope telescope has none"),
        ({"joints": None}, "4 lengths are given for 0 joints"),
        ({"arm": __file__}, "leave it out, or --arm"),
    ],
)
def test_what_is_no_arm_is_refused_and_nothing_is_written(
    more: dict, said: str, tmp_path: Path
) -> None:
    with pytest.raises(SettingsError, match=said):
        hydroid.init(tmp_path / "mine", **(EXCAVATOR | more))
    assert not (tmp_path / "mine").exists()
