"""Logs as machines record them are read rightly by what `init` writes, or a line says
what is wrong."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from field_logs import (
    FIELD_LOGS,
    JOINTS,
    Columns,
    FieldLog,
    make_truth,
    outcome,
    table,
    text,
)

import hydroid
from hydroid.errors import LogError
from hydroid.log import Log
from hydroid.settings.arm import Arm, load_arm

pytestmark = pytest.mark.usefixtures("no_picture", "short_searches")


@pytest.fixture(scope="module")
def arm(tmp_path_factory: pytest.TempPathFactory) -> Arm:
    """The template's."""
    home = tmp_path_factory.mktemp("template")
    hydroid.init(home / "mine")
    return load_arm(home / "mine" / "arm.yaml")


@pytest.mark.parametrize("log", FIELD_LOGS, ids=lambda log: log.name)
def test_a_log_is_read_rightly_or_its_fault_is_said(
    log: FieldLog, arm: Arm, tmp_path: Path
) -> None:
    found = outcome(log, tmp_path, arm)
    assert found.verdict == ("said" if log.said else "right"), found.line


def scaled(columns: Columns, word: str, scale: float) -> Columns:
    """Return columns, those with a word in their names in another unit."""
    return {k: scale * v if word in k else v for k, v in columns.items()}


@pytest.mark.parametrize(
    ("place", "change"),
    [
        (1, lambda columns: {k: v for k, v in columns.items() if "stick" not in k}),
        (1, lambda columns: columns | {"time_s": 1e3 * columns["time_s"]}),
        (
            2,
            lambda columns: (
                columns | {"boom_cmd_pct": 1500 + 5 * columns["boom_cmd_pct"]}
            ),
        ),
        (2, lambda columns: scaled(columns, "cmd", 0.01)),
    ],
    ids=[
        "a joint is missing",
        "ms",
        "pulses in the log to validate on",
        "commands in +-1",
    ],
)
def test_a_log_that_differs_from_the_first_is_left_out_of_the_commands(
    place: int, change: Callable[[Columns], Columns], tmp_path: Path
) -> None:
    columns = table(make_truth((70, -60, 100)))
    logs = [tmp_path / name for name in ("first.csv", "second.csv", "third.csv")]
    for number, log in enumerate(logs):
        log.write_text(text(change(columns) if number == place else columns))
    made = hydroid.init(tmp_path / "mine", log=logs).result
    (reason,) = [one for one in made.columns if "left out of the commands" in one]
    assert str(logs[place]) in reason
    assert made.commands
    for command in made.commands:
        assert str(logs[place]) not in command


@pytest.mark.parametrize("exchanged", [True, False])
def test_a_joint_that_follows_anothers_command_is_named(
    exchanged: bool, tmp_path: Path
) -> None:
    columns = table(make_truth((70, -60, 100)))
    boom, stick = (name for name in columns if "angle" in name)
    if exchanged:
        columns |= {boom: columns[stick], stick: columns[boom]}
    log = tmp_path / "log.csv"
    log.write_text(text(columns))
    sizes = {"joints": [*JOINTS], "lengths": ["2", "2"]}
    made = hydroid.init(tmp_path / "mine", log=log, **sizes).result
    said = [one for one in made.columns if "and not its own" in one]
    assert [one.split(" follows")[0] for one in said] == [*JOINTS] * exchanged


def test_a_log_of_one_signal_per_row_is_said_to_need_columns(tmp_path: Path) -> None:
    log = tmp_path / "log.csv"
    rows = ("0.00,BoomCmd,0.0", "0.01,BoomAngle,24.9", "0.02,BoomCmd,10.0")
    log.write_text("\n".join(["Timestamp,Signal,Value", *rows, ""]))
    made = hydroid.init(tmp_path / "mine", log=log).result
    assert made.missing == (
        "a row holds one signal (Signal and Value), and each signal needs a column"
    )


def test_angles_in_rad_beside_others_in_deg_widen_no_range(tmp_path: Path) -> None:
    """The arm of boxes has the ranges that logs reach."""
    columns = table(make_truth((70, -60, 100)))
    logs = [tmp_path / name for name in ("deg.csv", "rad.csv")]
    logs[0].write_text(text(columns))
    logs[1].write_text(text(scaled(columns, "angle", np.pi / 180)))
    sizes = {"joints": [*JOINTS], "lengths": ["2", "2"]}
    made = hydroid.init(tmp_path / "mine", log=logs, **sizes).result
    (reason,) = [one for one in made.columns if "left out of the commands" in one]
    assert str(logs[1]) in reason
    assert "rad" in reason
    assert all(str(logs[1]) not in command for command in made.commands)


@pytest.mark.parametrize("label", ["counts", "wire_V"])
def test_a_sensor_that_counts_backwards_gives_the_same_angles(
    label: str, tmp_path: Path
) -> None:
    """Of the sensor alone: a command that is wired the other way is another thing."""
    read = list[Log]()
    for way in (1, -1):
        columns = table(make_truth((70, -60, 100)))
        for name in JOINTS:
            angle = columns.pop(f"{name}_angle_deg")
            columns[f"{name}_{label}"] = 5000 + way * 10 * angle
        folder = tmp_path / f"way {way}"
        folder.mkdir()
        log = folder / "log.csv"
        log.write_text(text(columns))
        made = hydroid.init(folder / "mine", log=log).result
        backwards = [one for one in made.columns if "counts backwards" in one]
        # rods of the template lengthen with the boom's angle, and not with the stick's
        turned = {
            1: {"counts": [], "wire_V": ["stick"]},
            -1: {"counts": JOINTS, "wire_V": ["boom"]},
        }
        assert len(backwards) == len(turned[way][label])
        for line, name in zip(backwards, turned[way][label], strict=True):
            assert line.startswith(f"{name}_{label} counts backwards")
        settings = hydroid.load_settings(folder / "mine" / "fit.yaml")
        (part,) = hydroid.read_logs(log, settings)
        read.append(part)
    np.testing.assert_allclose(read[0].angle, read[1].angle, atol=1e-4)
    np.testing.assert_array_equal(read[0].command, read[1].command)


def test_rows_without_a_signal_are_left_out(arm: Arm, tmp_path: Path) -> None:
    (log,) = [
        log for log in FIELD_LOGS if log.name == "a receiver that loses its signal"
    ]
    outcome(log, tmp_path, arm)
    config = tmp_path / "mine" / "fit.yaml"
    lines = [
        str(line) for line in hydroid.check(tmp_path / "log.csv", config=config).lines
    ]
    assert any("a lost signal" in line and "29 more" in line for line in lines)


def test_a_joint_whose_sensor_has_failed_is_left_out_and_not_fitted(
    tmp_path: Path,
) -> None:
    """Among logs of which another one shows its motion it may be."""
    columns = table(make_truth((70, -60, 100)))
    good, dead = tmp_path / "good.csv", tmp_path / "dead.csv"
    good.write_text(text(columns))
    columns["boom_angle_deg"] = np.full_like(columns["time_s"], 15.0)
    dead.write_text(text(columns))
    made = hydroid.init(tmp_path / "dead", log=dead).result
    assert any("boom: driven, but the angle never" in one for one in made.columns)
    settings = hydroid.load_settings(tmp_path / "dead" / "fit.yaml")
    assert settings.outputs == (2,)
    assert settings.log.columns("command", 1) is None
    assert hydroid.check(dead, config=settings).exit_status == 0
    hydroid.init(tmp_path / "good", log=good)
    settings = hydroid.load_settings(tmp_path / "good" / "fit.yaml")
    assert hydroid.check(dead, config=settings).exit_status == 2
    assert hydroid.check([good, dead], config=settings).exit_status == 0
    with pytest.raises(LogError, match="boom is driven and compared, but the angle"):
        hydroid.fit(settings, dead)
