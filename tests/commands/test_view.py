"""`view` beyond its window: collisions, two arms."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from command_line import Run
from made_logs import TRUTH

import hydroid
from hydroid import load_settings
from hydroid.errors import LogError
from hydroid.identified_model import IdentifiedModel, identified
from hydroid.log import Log
from hydroid.settings.arm import Arm


@pytest.fixture(scope="module")
def model() -> IdentifiedModel:
    return identified(
        load_settings("article-mech", {"start_pose": "study"}), TRUTH, "truth"
    )


@pytest.mark.skipif(
    sys.platform != "linux", reason="elsewhere there is always a display"
)
def test_without_a_display_the_viewer_says_so_and_names_the_other_way(tmp_path: Path):
    blind = {
        k: v for k, v in os.environ.items() if k not in ("DISPLAY", "WAYLAND_DISPLAY")
    }
    command = [sys.executable, "-m", "hydroid", "view", "-q"]
    done = subprocess.run(
        command, cwd=tmp_path, capture_output=True, text=True, timeout=120, env=blind
    )
    assert done.returncode == 2
    assert done.stderr.startswith("hydroid: no window can be opened")
    assert "hydroid view RUN -o arm.mp4" in done.stderr
    assert len(done.stderr.splitlines()) == 1


def test_one_log_moves_both_arms_as_mirror_images(
    model: IdentifiedModel, study_log: Log, tmp_path: Path
):
    both = hydroid.simulate(
        study_log, fit=model, arm="both", out=tmp_path / "both.csv"
    ).result
    alone = hydroid.simulate(study_log, fit=model, out=None).log
    for side in ("right", "left"):
        np.testing.assert_array_equal(both[side].angle, alone.angle)
    header = (tmp_path / "both.csv").read_text().partition("\n")[0].split(",")
    assert {"time_s", "right_u2_pct", "left_u2_pct", "left_q7_deg"} <= set(header)
    again = hydroid.simulate(
        tmp_path / "both.csv", fit=model, arm="left", out=None
    ).result
    assert list(again) == ["left"]
    np.testing.assert_allclose(again["left"].angle, alone.angle, atol=1e-9)


def test_each_arm_has_its_own_columns(model: IdentifiedModel, tmp_path: Path):
    rows = np.zeros((200, 3))
    rows[:, 0] = 0.01 * np.arange(200)
    rows[:100, 1:] = 50.0, -50.0
    header = "time_s,right_u2_pct,left_u3_pct"
    np.savetxt(tmp_path / "own.csv", rows, "%.9g", ",", header=header, comments="")
    both = hydroid.simulate(
        tmp_path / "own.csv", fit=model, arm="both", out=None
    ).result
    assert [np.flatnonzero(log.driven).tolist() for log in both.values()] == [[1], [2]]
    np.testing.assert_array_equal(both["left"].command[:, 2], rows[:, 2])
    with pytest.raises(LogError, match="u1_pct"):
        hydroid.simulate(tmp_path / "own.csv", fit=model, out=None)


def test_the_exit_status_says_whether_bodies_meet(arm: Arm, hydroid_cli: Run):
    """The azimuth turns 45 deg to the other arm and back; the arm is stretched."""
    time, (_, shoulder, *_) = 0.01 * np.arange(401), np.degrees(arm.pose("home"))
    swing = 45 * np.sin(np.pi * time / 4) ** 2
    rows = np.column_stack([time, swing, np.full(401, shoulder)])
    np.savetxt("a.csv", rows, "%.9g", ",", header="time_s,q1_deg,q2_deg", comments="")
    assert (
        json.loads(hydroid_cli("view", "a.csv", "--collisions", "--json").out)["free"]
        is True
    )
    beside = ("view", "a.csv", "--collisions", "--arm", "right")
    assert " mm deep" in hydroid_cli(*beside, code=1).out
    content = json.loads(hydroid_cli(*beside, "--json", code=1).out)
    assert content["clearance_m"] == -max(
        each["depth_m"] for each in content["collisions"]
    )
    Path("b.csv").write_text(
        "time_s,x\n" + "".join(f"{k / 100},0\n" for k in range(200))
    )
    assert "lacks 'q1_deg'" in hydroid_cli("view", "b.csv", "--collisions", code=2).err
