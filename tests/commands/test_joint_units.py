"""JSON of commands states joints that slide in mm."""

from pathlib import Path

import numpy as np
import pytest

import hydroid
from hydroid.commands.joint_units import in_joint_units
from hydroid.settings.arm import Arm, load_arm

CRANE = """<robot name="crane"><link name="base"/>
<link name="boom"><inertial><origin xyz="1 0 0"/><mass value="90"/>
  <inertia ixx="2" ixy="0" ixz="0" iyy="20" iyz="0" izz="20"/></inertial></link>
<link name="rod"><inertial><origin xyz="1 0 0"/><mass value="40"/>
  <inertia ixx="1" ixy="0" ixz="0" iyy="9" iyz="0" izz="9"/></inertial></link>
<joint name="boom" type="revolute"><parent link="base"/><child link="boom"/>
  <axis xyz="0 -1 0"/><limit lower="-0.5" upper="1" effort="1" velocity="1"/></joint>
<joint name="telescope" type="prismatic"><parent link="boom"/><child link="rod"/>
  <axis xyz="1 0 0"/><limit lower="0" upper="1.5" effort="1" velocity="1"/></joint>
</robot>"""
"""a boom that turns, and a telescope in it"""


@pytest.fixture
def crane(tmp_path: Path) -> Arm:
    (tmp_path / "crane.urdf").write_text(CRANE)
    hydroid.init(tmp_path / "mine", arm=tmp_path / "crane.urdf")
    return load_arm(tmp_path / "mine" / "arm.yaml")


def test_rows_and_numbers_by_joint_are_in_mm_where_it_slides(crane: Arm) -> None:
    degree = float(np.degrees(1e-3))  # of 1 mm, as files keep it
    rows = [
        {"joint": 1, "name": "boom", "rms_deg": 2.0},
        {
            "joint": 2,
            "name": "telescope",
            "rms_deg": 2 * degree,
            "unseen_deg": None,
            "baselines_deg": {"standing still": degree},
            "compared": {"x": {"difference_deg2": [degree**2]}},
        },
    ]
    content = {"rows": rows, "moved_deg": {"boom": 3.0, "telescope": 5 * degree}}
    changed = in_joint_units(content, crane)
    turning, sliding = changed["rows"]
    assert turning == rows[0]
    assert sliding.keys() == {
        "joint",
        "name",
        "rms_mm",
        "unseen_mm",
        "baselines_mm",
        "compared",
    }
    assert sliding["rms_mm"] == pytest.approx(2)
    assert sliding["unseen_mm"] is None
    assert sliding["baselines_mm"]["standing still"] == pytest.approx(1)
    assert sliding["compared"]["x"]["difference_mm2"] == [pytest.approx(1)]
    assert changed["moved_deg"] == {"boom": 3.0}
    assert changed["moved_mm"] == {"telescope": pytest.approx(5)}
    assert rows[1]["rms_deg"] == 2 * degree


def test_check_says_how_far_a_telescope_moves(crane: Arm, tmp_path: Path) -> None:
    time = np.arange(0, 20, 0.02)
    command = 50 * np.sin(0.6 * time) * (time > 1)
    way = 0.6 - 0.5 * np.cos(0.6 * time)
    columns = [time, command, np.degrees(0.2 * way), command, way]
    names = "time_s,boom_cmd_pct,boom_deg,telescope_cmd_pct,telescope_m"
    log = tmp_path / "a.csv"
    np.savetxt(log, np.stack(columns, 1), delimiter=",", header=names, comments="")
    hydroid.init(tmp_path / "with_log", arm=Path(crane.where), log=log)
    checked = hydroid.check(log, config=tmp_path / "with_log" / "fit.yaml")
    (one,) = checked.content["logs"]
    assert one["moved_deg"].keys() == {"boom"}
    assert one["moved_mm"]["telescope"] == pytest.approx(1000, rel=0.05)
