"""What `hydroid check` says of logs that are wrong in many ways; docs/logs.md shows the same."""

from pathlib import Path

import numpy as np
import pytest
from wrong_logs import ROOT, WRONG, Wrong, boom, rig, save, told

import hydroid

SETTINGS = hydroid.load_settings("fit-mech")


@pytest.mark.parametrize("wrong", WRONG, ids=lambda wrong: wrong.how)
def test_it_is_said_and_the_page_shows_it(wrong: Wrong, tmp_path: Path) -> None:
    line = next(x for x in told(wrong, tmp_path) if x.startswith(wrong.level) and wrong.said in x)
    page = (ROOT / "docs" / "logs.md").read_text()
    assert f"| {wrong.how} | {line} |\n" in page, "python tests/helpers/wrong_logs.py prints the table"


def findings(folder: Path, *tables: dict) -> list[tuple[str, str]]:
    result = hydroid.check(save(Wrong("", "", "", lambda: [*tables]), folder), config=SETTINGS).result
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


def test_a_finding_of_several_logs_is_said_once(tmp_path: Path) -> None:
    many = [{n: -v if n == "u2_pct" else v for n, v in rig(rows=2000).items()} for _ in range(5)]
    lines = told(Wrong("", "", "", lambda: many), tmp_path)
    (line,) = [line for line in lines if "against the command" in line]
    assert line.endswith("(and in 4 more logs: log2.csv, log3.csv, log4.csv, ...)")


def test_how_far_each_joint_moves(tmp_path: Path) -> None:
    (path,) = save(Wrong("", "", "", lambda: [boom([50])]), tmp_path)
    (log,) = hydroid.check([path], config=SETTINGS).result.logs
    angle = log.log.angle[:, 1]
    assert log.moved_deg == {2: pytest.approx(np.rad2deg(np.ptp(angle)), abs=0.2)}
