"""What commands read: angles that are not measured stay so, and parts of a log between
its gaps."""

import json
from pathlib import Path

import numpy as np
import pytest
from log_files import RIG, assert_same, head

from hydroid import check, convert, fit as run_fit, load_settings, read_logs, simulate
from hydroid.advice.assumptions import exchanged
from hydroid.commands.logs import run_logs
from hydroid.errors import LogError, SettingsError
from hydroid.fitting.multistart import lone_joints
from hydroid.log import Log, check_parts
from hydroid.posterior.error_model import likelihood_at
from hydroid.problem.problem import Problem
from hydroid.settings.fit import FitSettings
from hydroid.settings.log import LogSettings

LOG = RIG / "rig_all_joints_1.csv"
UNMEASURED = {"log.joints.3.angle": None}


def settings(**changes: object) -> FitSettings:
    own = {
        f"parameters.own_{j}": {
            "quantity": "overlap",
            "joints": [j],
            "bounds": [0.0, 0.8],
        }
        for j in (2, 4)
    }
    return load_settings(
        "fit-hyd", {"outputs": [2, 4], "start_pose": "study", **own, **changes}
    )


def read(**changes: object) -> tuple[Log, FitSettings]:
    fit = settings(**changes)
    (log,) = read_logs(LOG, fit)
    return log, fit


def test_an_unmeasured_joint_is_unmeasured_and_starts_in_the_start_pose() -> None:
    log, fit = read(**UNMEASURED)
    assert log.has_angle.tolist() == [joint != 3 for joint in range(1, 8)]
    assert np.isnan(log.angle[:, 2]).all()
    assert log.start[2] == fit.arm.pose("study")[2]
    np.testing.assert_array_equal(log.posed[:, 2], fit.arm.pose("study")[2])
    whole, _ = read()
    there = [joint != 2 for joint in range(7)]
    np.testing.assert_array_equal(log.start[there], whole.start[there])
    np.testing.assert_array_equal(whole.posed, whole.angle)


def test_a_log_that_was_read_elsewhere_has_a_start_pose_too() -> None:
    log, fit = read(**UNMEASURED)
    (again,) = read_logs(
        Log(log.source, log.time, log.command, log.angle, log.period), fit
    )
    np.testing.assert_array_equal(again.start, log.start)


def test_what_needs_the_motion_of_driven_joints_leaves_out_logs_that_lack_it() -> None:
    """A start is open, joints are fitted alone and columns compared only where joints
    are measured."""
    log, fit = read(**UNMEASURED)
    problem, whole = Problem(fit, [log]), Problem(settings(), [read()[0]])
    assert 3 in whole.started(whole.logs[0])
    assert 3 not in problem.started(log)
    assert lone_joints(whole) == (2, 4)
    assert lone_joints(problem) == ()
    assert exchanged(fit, [log]) == ()


@pytest.mark.parametrize("others", ["measured", "locked", "passive"])
def test_a_log_without_an_angle_is_simulated(others: str, tmp_path: Path) -> None:
    """A joint that is neither driven nor measured stands in its pose where others
    follow the log."""
    changes = {
        **UNMEASURED,
        "log.joints.3.command": None,
        "simulation.other_joints": others,
    }
    log, fit = read(**changes)
    response = Problem(fit, [log]).responses(fit.parameter_set().start[None])[0].angle
    assert np.isfinite(response).all()


def test_a_simulation_from_a_named_pose_starts_there_and_writes_all_angles(
    tmp_path: Path,
) -> None:
    truth = RIG.parent / "article" / "truth.yaml"
    log = simulate(
        RIG / "rig_shoulder_1.csv", fit=truth, pose="study", out=tmp_path / "log.csv"
    ).log
    assert log.has_angle.all()
    np.testing.assert_allclose(
        log.start, load_settings("fit-hyd").arm.pose("study"), atol=1e-3
    )


def gapped(folder: Path) -> Path:
    """The log of the rig without 0.4 s."""
    rows = LOG.read_text().splitlines()
    path = folder / "log.csv"
    path.write_text("\n".join([*rows[:1001], *rows[1041:2001]]))
    return path


def test_a_gap_gives_two_logs_that_share_the_files_payload_and_group(
    tmp_path: Path,
) -> None:
    path = gapped(tmp_path)
    fit = settings(
        **{"payloads": {"log.csv": 50.0}, "log.groups": {"monday": "log.csv"}}
    )
    one, two = read_logs(path, fit)
    assert (one.source, two.source) == (f"{path}[1]", f"{path}[2]")
    assert fit.log.group_of(two.source) == "monday"
    loaded, plain = (Problem(s, [two]) for s in (fit, fit.changed({"payloads": {}})))
    theta = fit.parameter_set().start[None]
    assert not np.array_equal(loaded.output_errors(theta), plain.output_errors(theta))


def test_logs_of_one_name_have_payloads_and_groups_of_their_own(tmp_path: Path) -> None:
    days = [tmp_path / day / "log.csv" for day in ("monday", "tuesday", "friday")]
    for day, lines in zip(days, (200, 210, 220), strict=True):
        day.parent.mkdir()
        head(day, lines)
    monday, tuesday, friday = (str(day) for day in days)
    fit = settings(
        payloads={"log.csv": 50.0, "tuesday/log.csv": 80.0},
        **{"log.groups": {"cold": ["monday/*.csv", "fri*/log.csv"]}},
    )
    assert [fit.payload_of(day) for day in (monday, tuesday)] == [50.0, 80.0]
    assert fit.payload_of(f"{tuesday}[2]") == 80.0
    assert fit.payload_of("yesterday/logs.csv") == 0.0
    assert fit.log.group_of(monday) == fit.log.group_of(friday) == "cold"
    assert fit.log.group_of(tuesday) == fit.log.group_of("log.csv") == "other"
    # which of two is meant?
    with pytest.raises(
        SettingsError, match=r"payloads\.log\.csv: is .*monday.* and .*fri"
    ):
        run_fit(fit, days)


def test_a_log_with_a_hole_gives_the_likelihoods_rows_of_its_two_parts(
    tmp_path: Path,
) -> None:
    path = gapped(tmp_path)
    name, *rows = path.read_text().splitlines()
    halves = [tmp_path / "before.csv", tmp_path / "after.csv"]
    for half, own in zip(halves, (rows[:1000], rows[1000:]), strict=True):
        half.write_text("\n".join([name, *own]))
    fit = settings()
    holed = Problem(fit, read_logs(path, fit))
    before, after = read_logs(halves, fit)
    # what is behind a gap may be in motion
    apart = Problem(fit, [before, after.in_motion()])
    # of a later one the start is a mean, with the gap or without
    assert apart.logs[1].first_command == 0
    theta = fit.parameter_set().start
    rows_of = [
        likelihood_at(problem, theta).rows(theta[None]) for problem in (holed, apart)
    ]
    np.testing.assert_array_equal(*rows_of)
    np.testing.assert_array_equal(
        holed.evaluate(theta[None]), apart.evaluate(theta[None])
    )


def test_what_needs_one_log_refuses_parts(tmp_path: Path) -> None:
    truth = RIG.parent / "article" / "truth.yaml"
    with pytest.raises(
        LogError, match="gaps split it into 2 parts, and one log is needed"
    ):
        simulate(gapped(tmp_path), fit=truth, out=tmp_path / "out.csv")
    assert not (tmp_path / "out.csv").exists()


def test_check_speaks_of_each_part(tmp_path: Path) -> None:
    checked = check(gapped(tmp_path))
    assert [len(one.log.time) for one in checked.result] == [1000, 960]
    assert checked.exit_status == 0
    assert [row["log"][-3:] for row in checked.content["logs"]] == ["[1]", "[2]"]


def test_convert_keeps_gaps(tmp_path: Path) -> None:
    path, out = gapped(tmp_path), tmp_path / "out.csv"
    convert(path, out=out)
    ranges = load_settings("fit-hyd").arm.ranges
    (before, after) = (
        check_parts(one, LogSettings(), ranges)[0] for one in (path, out)
    )
    assert [part.begin for part in after] == pytest.approx(
        [part.begin for part in before]
    )
    for one, other in zip(before, after, strict=True):
        assert_same(one, other)


def test_a_run_of_parts_finds_its_file_again(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    folder.mkdir()
    path = gapped(tmp_path)
    (folder / "run.json").write_text(
        json.dumps({"logs": {f"{path}[1]": "a", f"{path}[2]": "b"}})
    )
    assert run_logs(folder) == [path]
