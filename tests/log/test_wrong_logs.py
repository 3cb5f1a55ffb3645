"""What `hydroid check` says of logs that are wrong in many ways; docs/logs.md shows the same."""

from pathlib import Path

import numpy as np
import pytest
from log_files import RIG_RANGES
from wrong_logs import ROOT, WRONG, Wrong, boom, rig, save

import hydroid
from hydroid.log import check_log
from hydroid.settings.log import LogSettings

SETTINGS = hydroid.load_settings("fit-mech")


@pytest.mark.parametrize("wrong", WRONG, ids=lambda wrong: wrong.how)
def test_it_is_said_and_the_page_shows_it(wrong: Wrong, tmp_path: Path) -> None:
    line = wrong.line(tmp_path)
    page = (ROOT / "docs" / "logs.md").read_text()
    assert f"| {wrong.how} | {line} |\n" in page, "python tests/helpers/wrong_logs.py prints the table"


def findings(folder: Path, *tables: dict) -> list[tuple[str, str]]:
    result = hydroid.check(save(Wrong("", "", lambda: [*tables]), folder), config=SETTINGS).result
    every = [f for log in result.logs for f in log.findings] + result.findings
    return [(finding.level, finding.kind) for finding in every]


def test_a_good_log_has_no_finding_but_its_gaps(tmp_path: Path) -> None:
    assert findings(tmp_path, rig(rows=7500)) == [("note", "open valve curve")]


@pytest.mark.parametrize("duties", [[60, -60, 100, -100], [100, 100, -80, -80], [90], [-90, -90]])
@pytest.mark.parametrize("stop", [22.0, 30.0, 60.0])
def test_a_stop_is_neither_a_delay_nor_another_sign(duties: list[float], stop: float, tmp_path: Path) -> None:
    kinds = [kind for _, kind in findings(tmp_path, boom(duties, stop=stop, seconds=8))]
    assert "at a stop" in kinds
    assert not {"late", "direction"} & {*kinds}


def test_how_far_each_joint_moves(tmp_path: Path) -> None:
    (path,) = save(Wrong("", "", lambda: [boom([50])]), tmp_path)
    (log,) = hydroid.check([path], config=SETTINGS).result.logs
    angle = log.log.angle[:, 1]
    assert log.moved_deg == {2: pytest.approx(np.rad2deg(np.ptp(angle)), abs=0.2)}


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
