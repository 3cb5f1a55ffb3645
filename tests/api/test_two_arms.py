"""Two arms in commands: read by their names, simulated as mirror images, and held against each other."""

import json
from pathlib import Path

import numpy as np
import pytest
from conftest import step_log
from typer.testing import CliRunner

import hydroid
from hydroid import load_settings
from hydroid.cli.app import app
from hydroid.errors import LogError, SettingsError
from hydroid.identified_model import IdentifiedModel, identified
from hydroid.log import Log
from hydroid.settings.arm import Arm
from hydroid.settings.two_arms import columns_of

VALUES = {"K": 0.2, "D": 231.8, "S": 53.4, "M1": 4.6, "M2": 5.1, "M3": 22.5, "M4": 1.6, "M5": 4.0, "M6": 4.7}


@pytest.fixture(scope="module")
def model() -> IdentifiedModel:
    return identified(load_settings("article-mech", {"start_pose": "study"}), VALUES, "truth")


def crossing(arm: Arm) -> Log:
    """A trajectory in which the azimuth turns 45 deg to the other arm and back; the arm is stretched."""
    time = 0.01 * np.arange(401)
    angle = np.tile(arm.pose("home"), (401, 1))
    angle[:, 0] = np.radians(45) * np.sin(np.pi * time / 4) ** 2
    return Log("crossing", time, np.zeros((401, 7)), angle, 0.01)


def write_arms(path: Path, model: IdentifiedModel, logs: dict[str, Log]) -> Path:
    hydroid.simulate_arms(model, logs, path)
    return path


def test_one_log_moves_both_arms_as_mirror_images(model: IdentifiedModel, study_log: Log, tmp_path: Path):
    logs = hydroid.read_arms(study_log, model.settings, "both")
    found = hydroid.simulate_arms(model, logs, tmp_path / "both.csv")
    alone = hydroid.simulate(model, study_log)
    for side in ("right", "left"):
        np.testing.assert_array_equal(found[side].angle, alone.angle)
    header = (tmp_path / "both.csv").read_text().partition("\n")[0].split(",")
    assert {"time_s", "right_u2_pct", "left_u2_pct", "left_q7_deg"} <= set(header)
    again = hydroid.read_arms(tmp_path / "both.csv", model.settings, "left")
    assert list(again) == ["left"]
    np.testing.assert_allclose(again["left"].angle, alone.angle, atol=1e-9)


def test_each_arm_has_its_own_columns(model: IdentifiedModel, arm: Arm, tmp_path: Path):
    own = {
        "right": step_log(arm.pose("study"), [50.0, 0.0]),
        "left": step_log(arm.pose("study"), [-50.0, 0.0], joint=3),
    }
    path = write_arms(tmp_path / "own.csv", model, own)
    read = hydroid.read_arms(path, model.settings, "both")
    for side, log in own.items():
        np.testing.assert_array_equal(read[side].command, log.command)
    with pytest.raises(LogError, match="u1_pct"):
        hydroid.read_arms(path, model.settings, None)


def test_columns_of_single_joints_are_named_too(model: IdentifiedModel):
    changed = load_settings("fit-mech", {"log.joints": {2: {"command": {"column": ["up", "down"]}}, 4: None}})
    left = columns_of(changed.log, "left")
    command, angle, none = left.columns("command", 2), left.columns("angle", 3), left.columns("command", 4)
    assert command is not None
    assert command.column == ("left_up", "left_down")
    assert angle is not None
    assert angle.column == "left_q3_deg"
    assert none is None


def test_an_arm_that_is_none_is_refused(model: IdentifiedModel, study_log: Log):
    with pytest.raises(SettingsError, match=r"'middle' is no arm of a pair.*right, left or both"):
        hydroid.read_arms(study_log, model.settings, "middle")


def test_a_crossing_is_found_and_only_beside_another_arm(model: IdentifiedModel, arm: Arm):
    settings = load_settings("fit-mech")
    alone = hydroid.collisions(crossing(arm), settings, None).result
    assert not alone.meetings
    beside = hydroid.collisions(crossing(arm), settings, None, arm="right").result
    assert {beside.meetings[0].first[:5], beside.meetings[0].second[:4]} == {"right", "left"}
    assert beside.distance == pytest.approx(beside.distance[::-1], abs=1e-6)  # there and back
    # mirror images meet in the middle, so sooner, and half as far round
    both = hydroid.collisions(crossing(arm), settings, None, arm="both").result
    assert both.meetings[0].begins < beside.meetings[0].begins


def test_the_command_says_it_by_its_exit_status(arm: Arm, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)
    log = crossing(arm)
    degrees = np.column_stack([log.time, np.degrees(log.angle[:, :2])])
    np.savetxt("a.csv", degrees, "%.9g", ",", header="time_s,q1_deg,q2_deg", comments="")
    run = CliRunner().invoke
    free = run(app, ["collisions", "a.csv", "--json"])
    assert free.exit_code == 0, free.output
    assert json.loads(free.stdout)["free"] is True
    met = run(app, ["collisions", "a.csv", "--arm", "right", "--out", "found"])
    assert met.exit_code == 1
    assert "Bodies meet once, first" in " ".join(met.stdout.split())
    assert {path.name for path in Path("found").iterdir()} == {"collisions.html", "tables", "figures"}
    content = json.loads(run(app, ["collisions", "a.csv", "--arm", "right", "--json"]).stdout)
    assert content["clearance_m"] == -max(each["depth_m"] for each in content["collisions"])
    Path("b.csv").write_text("time_s,x\n" + "".join(f"{k / 100},0\n" for k in range(200)))
    with pytest.raises(LogError, match="lacks 'q1_deg'"):
        run(app, ["collisions", "b.csv"], catch_exceptions=False)
