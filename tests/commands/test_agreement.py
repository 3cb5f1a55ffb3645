"""`check` compares logs: one of another speed is named, with its time of day and load;
equal ones are not."""

import json
from pathlib import Path

import numpy as np
import pytest
from command_line import Run
from log_files import RIG

NAMES = "time_s,u2_pct,q2_deg"


@pytest.fixture
def logs(tmp_path: Path) -> list[Path]:
    """Four logs of a rig, with noise of their own; the third begins at half past
    twelve."""
    lines = (RIG / "rig_shoulder_1.csv").read_text().splitlines()
    names = lines[0].split(",")
    cells = np.array([line.split(",") for line in lines[1:1501]], float)
    time, command, angle = (cells[:, names.index(name)] for name in NAMES.split(","))
    paths = list[Path]()
    for k in range(4):
        path = tmp_path / f"day_{k}.csv"
        noise = np.random.default_rng(k).normal(0, 0.05, len(time))
        columns = [time.astype(str), command.astype(str), (angle + noise).astype(str)]
        if k == 2:
            stamps = np.datetime64("2026-03-01T12:30:00") + np.round(1e3 * time).astype(
                "m8[ms]"
            )
            columns[0] = stamps.astype(str)
            columns[2] = (angle[0] + 0.8 * (angle - angle[0]) + noise).astype(str)
        rows = [",".join(row) for row in zip(*columns, strict=True)]
        path.write_text("\n".join([NAMES, *rows]) + "\n")
        paths.append(path)
    return paths


def test_the_log_that_stands_out_is_named_with_its_conditions(
    logs: list[Path], hydroid_cli: Run
) -> None:
    payload = "--set=payloads={day_2.csv: 250}"
    ended = hydroid_cli("check", *logs, payload)
    assert "joint shoulder moves at 0.8" in ended.out
    assert "times its speed in the other logs (12:30:00, load 250 kg)" in ended.out
    assert "Do the logs agree?" in ended.out
    rows = json.loads(hydroid_cli("check", *logs, "--json").out)["agreement"]
    assert [row["stands_out"] for row in rows] == [None, None, "speed", None]
    assert rows[2]["speed"] == pytest.approx(0.8, abs=0.03)


def test_equal_logs_are_said_to_agree(logs: list[Path], hydroid_cli: Run) -> None:
    equal = [logs[k] for k in (0, 1, 3)]
    assert (
        "No log stands out in speed, dead bands or delay of shoulder"
        in hydroid_cli("check", *equal).out
    )
    assert "Do the logs agree?" in hydroid_cli("check", *equal, "-v").out
