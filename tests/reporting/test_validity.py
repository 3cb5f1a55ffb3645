"""The page says what the logs cover, and what they lack."""

from dataclasses import replace

import numpy as np
import pytest
from report_fits import make_fit, make_prediction, make_problem, make_record

from hydroid.log import Log
from hydroid.reporting.validity_report import covered, log_next, validity_section

PROBLEM = make_problem(outputs=(2, 3), samples=400)
RECORD = make_record(PROBLEM, make_fit(PROBLEM))


def log_of(*commands: list[float]) -> Log:
    """A log of 2 s whose shoulder and elbow get these commands, a second each, and turn
    by 0.01 rad/s per %."""
    log = PROBLEM.logs[0].part(0, 200)
    command = np.zeros_like(log.command)
    for joint, levels in enumerate(commands, 1):
        command[:, joint] = np.repeat(levels, 100)
    angle = 0.2 + 1e-4 * np.cumsum(np.vstack([0 * command[:1], command[:-1]]), axis=0)
    return replace(log, command=command, angle=angle)


def record_of(*logs: Log):
    fitted = tuple(make_prediction(log, joints=(2, 3)) for log in logs)
    return replace(RECORD, result=replace(RECORD.result, fitted=fitted))


def test_commands_positions_and_speeds_are_those_of_the_logs():
    log = log_of([50.0, -20.0], [0.0, 0.0])
    one = covered(PROBLEM.settings, [log], 2)
    np.testing.assert_allclose(one.ends[0], [-20.0, 50.0])
    np.testing.assert_allclose(one.ends[1], [0.2, 0.7], atol=0.01)
    np.testing.assert_allclose(one.ends[2], [-0.2, 0.5], atol=1e-6)
    assert one.seconds == pytest.approx((1.0, 1.0))
    assert one.smallest == pytest.approx({1.0: 50.0, -1.0: 20.0})
    low, high = one.range
    assert one.share == pytest.approx(0.5 / (high - low), abs=0.01)


def test_what_the_logs_lack_is_what_to_log_next():
    run = record_of(log_of([50.0, 30.0], [40.0, -60.0]))
    section = validity_section(run)
    reached = "commands [%] up to: shoulder 0 and +50, elbow -60 and +40; none below 30"
    assert section.answer == f"free motion, {reached}"
    said = " ".join(log_next(run))
    assert "Log both directions of shoulder." in said
    # the elbow's commands have one size in each direction: its valve is on or off
    assert "Log larger commands of shoulder." in said
    assert "Log smaller commands of shoulder." in said
    assert "Log 4 unseen logs in all, to validate on. There are none." in said
    assert "several joints at once" not in said
    assert "hydroid suggest --fit RUN" in said
    # what the model leaves out, whatever the logs cover
    limits = " ".join(section.points)
    assert "Limit: oil temperature and engine speed as in the fitted logs" in limits


def test_nothing_is_asked_for_that_the_logs_have():
    ramp = [np.linspace(-100.0, 100.0, 100).tolist()] * 2
    log = log_of([0.0, 0.0])
    command = log.command.copy()
    command[:, [1, 2]] = np.array([*zip(*ramp, strict=True)] * 2)
    low, high = PROBLEM.settings.arm.stops(2)
    angle = np.linspace(low, high, 200)[:, None] * np.ones(log.joints)
    log = replace(log, command=command, angle=angle)
    unseen = {f"{n}": make_prediction(log, joints=(2, 3)) for n in range(4)}
    run = replace(record_of(log), validations=unseen)
    said = " ".join(log_next(run))
    for asked in ("both directions", "commands of", "poses of shoulder", "unseen"):
        assert asked not in said
