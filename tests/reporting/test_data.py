"""The page says which logs a fit is from, how they were recorded, and what drives them."""

from dataclasses import replace

import numpy as np
import pytest
from arms import CRANE, write_arm
from report_fits import make_fit, make_prediction, make_problem, make_record

from hydroid.fitting.validation import Prediction
from hydroid.log import FileRows, Log
from hydroid.reporting.data_report import NO_BREAK, data_section, moving_together
from hydroid.reporting.page import Table
from hydroid.run.record import FinishedRun
from hydroid.settings.log import EngineSpeed

PROBLEM = make_problem(outputs=(2, 3), samples=400)
RECORD = make_record(PROBLEM, make_fit(PROBLEM))


def log_of(shoulder: list[float], elbow: list[float], source: str = "a.csv") -> Log:
    """A log of 4 s whose shoulder and elbow get these commands, for equal times; both
    turn by 0.01 rad/s per %."""
    log = replace(PROBLEM.logs[0].part(0, 400), source=source)
    command = np.zeros_like(log.command)
    for column, levels in ((1, shoulder), (2, elbow)):
        command[:, column] = np.repeat(levels, 400 // len(levels))
    angle = 0.2 + 1e-4 * np.cumsum(np.vstack([0 * command[:1], command[:-1]]), axis=0)
    return replace(log, command=command, angle=angle)


def run_of(
    *logs: Log, unseen: tuple[Prediction, ...] = (), joints: tuple[int, ...] = (2, 3)
) -> FinishedRun:
    fitted = tuple(make_prediction(log, joints=joints) for log in logs)
    result = replace(RECORD.result, fitted=fitted)
    validations = {prediction.log.source: prediction for prediction in unseen}
    return replace(RECORD, result=result, validations=validations)


def lines(table: Table) -> list[list[str]]:
    """The cells of a table, with blanks of one kind."""
    return [[cell.replace(NO_BREAK, " ") for cell in row] for row in table.shown]


def test_each_log_says_how_it_was_recorded_and_which_joint_moves_how_far():
    fitted = log_of([50.0, -30.0], [0.0])
    fitted = replace(fitted, rows=FileRows(201, (0.018, 0.02, 0.031)))
    even = replace(
        log_of([0.0], [40.0, 0.0], "b.csv"), rows=FileRows(400, (0.01, 0.01, 0.01))
    )
    run = run_of(fitted, unseen=(make_prediction(even, joints=(2, 3)),))
    section = data_section(run)
    table = section.tables["logs"]
    assert table.header[-2:] == ("shoulder [deg]", "elbow [deg]")
    first, second = lines(table)
    travel = np.degrees(np.ptp(fitted.angle[:, 1]))
    assert first[:5] == ["a.csv", "fitted", "4", "201", "50, steps 18 to 31 ms"]
    assert first[5:] == [f"{travel:.2g} (-30 to +50 %)", "stands"]
    assert second[:5] == ["b.csv", "unseen", "4", "400", "100, even"]
    assert second[5] == "stands"
    assert second[6].endswith("(0 to +40 %)")
    assert section.answer.startswith(
        "1 log (4 s) fitted, 1 log (4 s) unseen; two or more"
    )
    assert not table.note
    assert (
        "Left out: nothing. No log has a gap, or a row without numbers."
        in section.points
    )


def test_what_was_left_out_is_said_once_for_a_file_with_its_reason():
    why = "line 102: 0.04 s without a sample, the log is split there"
    rows = FileRows(200, (0.01, 0.01, 0.01), (why,))
    parts = [replace(log_of([40.0], [0.0], f"dig.csv[{k}]"), rows=rows) for k in (1, 2)]
    section = data_section(run_of(*parts))
    assert [one for one in section.points if why in one] == [
        f"Left out or filled in dig.csv: {why}."
    ]
    assert "some rows left out" in section.answer


def test_joints_are_together_for_the_time_in_which_two_move():
    log = log_of([50.0, 50.0, 0.0, 0.0], [60.0, 0.0, 0.0, 60.0])
    shares = moving_together(PROBLEM.settings, [log])
    # a joint counts for a tenth of a second before it starts, and after it stops
    expected = (0.275, 0.525, 0.2)
    assert (shares.several, shares.one, shares.none) == pytest.approx(
        expected, abs=0.01
    )
    said = " ".join(data_section(run_of(log)).points)
    assert "move at once in 28 % of the time, one alone in 52 %, none in 20 %" in said
    always = log_of([50.0], [60.0])
    said = " ".join(data_section(run_of(always)).points)
    assert "move at once in all of the time." in said
    # a command that moves nothing
    held = replace(always, angle=log_of([50.0], [0.0]).angle)
    assert moving_together(PROBLEM.settings, [held]).several == 0.0


def test_the_commands_that_no_log_has_are_named():
    said = " ".join(data_section(run_of(log_of([40.0, -100.0], [55.0]))).points)
    assert "up to 100 %, and 40 % or more in 95 %" in said
    assert "nothing between −40 and +40 %" in said
    ramp = log_of([*np.linspace(-80.0, 80.0, 400)], [0.0])
    assert "nothing between" not in " ".join(data_section(run_of(ramp)).points)


def test_of_a_run_that_does_not_store_the_rows_the_page_says_so_and_stands():
    section = data_section(run_of(log_of([50.0], [20.0])))
    table = section.tables["logs"]
    assert "rate [Hz]" not in table.header
    assert table.shown[0][3] == "400"
    assert "an earlier version read" in table.note
    assert not any("Left out" in point for point in section.points)


def test_pressures_and_conditions_are_named_only_where_a_log_has_them():
    log = log_of([50.0], [20.0])
    assert "Pressures" not in " ".join(data_section(run_of(log)).points)
    pressure = np.full((*log.angle.shape, 2), np.nan)
    pressure[:, 1] = 1e5 * np.linspace(20.0, 180.0, 400)[:, None]
    conditions = np.column_stack([np.linspace(0.5, 1.1, 400), np.zeros(400)])
    run = run_of(replace(log, pressure=pressure, conditions=conditions), log)
    engine = EngineSpeed(column="rpm", reference=1800.0)
    settings = run.settings.changed({"log.engine_speed": engine})
    said = data_section(replace(run, settings=settings)).points
    assert "Pressures of the shoulder: measured in 1 of 2 logs, 20 to 180 bar." in said
    assert "Engine speed: 900 to 1980 rpm." in said


def test_a_telescope_moves_by_millimetres(tmp_path):
    arm = write_arm(tmp_path, CRANE)
    settings = PROBLEM.settings.changed({"arm": arm, "outputs": (2,), "parameters": {}})
    log = log_of([50.0, -50.0], [0.0])
    travel = np.linspace(0.0, 1.25, 400)
    log = replace(
        log, command=log.command[:, :2], angle=np.column_stack([0 * travel, travel])
    )
    run = replace(run_of(log, joints=(2,)), settings=settings)
    section = data_section(run)
    table = section.tables["logs"]
    assert table.header[-1] == "telescope [mm]"
    assert lines(table)[0][-1] == "1250 (-50 to +50 %)"
    # one joint is never together with others
    assert "Joints together" not in " ".join(section.points)
    assert "two or more" not in section.answer
