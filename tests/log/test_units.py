"""Suspected units: found where they are wrong, and silent on what a plain log may hold."""

from pathlib import Path

import numpy as np
import pytest
from log_files import RIG, RIG_RANGES

from hydroid.log import check_log
from hydroid.settings.log import LogSettings

LOGS = ("rig_shoulder_1", "rig_shoulder_2", "rig_all_joints_1")


def warned(tmp_path: Path, name: str, command: float = 1.0, angle: float = 1.0, offset: float = 0.0) -> str:
    """The warnings of a rig's log whose commands and angles are multiplied."""
    values = np.loadtxt(RIG / f"{name}.csv", delimiter=",", skiprows=1)[:4000]
    values[:, 1:8] *= command
    values[:, 8:] = values[:, 8:] * angle + offset
    with (RIG / f"{name}.csv").open() as file:
        header = file.readline().strip()
    path = tmp_path / "log.csv"
    np.savetxt(path, values, fmt="%.6f", delimiter=",", header=header, comments="")
    _, findings = check_log(path, LogSettings(angle_margin_deg=30), RIG_RANGES)
    return " ".join(f"{f.what}; {f.hint}" for f in findings if f.level == "warning")


@pytest.mark.parametrize("name", LOGS)
def test_plain_logs_raise_no_suspicion(tmp_path: Path, name: str) -> None:
    for how in ({}, {"command": 0.1}, {"angle": 0.3}, {"command": 0.01, "angle": 0.01}):
        said = warned(tmp_path, name, **how)
        assert "scale: 100" not in said
        assert "unit: rad" not in said


def test_small_motions_about_zero_are_not_taken_for_radians(tmp_path: Path) -> None:
    """A quick shake by strong commands stays within 3 deg, and yet moves far more than radians would."""
    time = np.arange(3000) * 0.01
    values = np.zeros((3000, 15))
    values[:, 0], values[:, 2] = time, 60 * np.sign(np.sin(2 * np.pi * 0.25 * time + 0.1))
    values[:, 9] = 2.5 * np.cos(2 * np.pi * 0.25 * time)
    names = ["time_s", *(f"u{j}_pct" for j in range(1, 8)), *(f"q{j}_deg" for j in range(1, 8))]
    path = tmp_path / "log.csv"
    np.savetxt(path, values, fmt="%.6f", delimiter=",", header=",".join(names), comments="")
    _, findings = check_log(path, LogSettings(), RIG_RANGES)
    assert not [f for f in findings if "rad" in f.hint and f.level == "warning"]
