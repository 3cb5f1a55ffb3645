"""Commands along a path: played on the model they lead it there, and what cannot be had
is said by name."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas
import pytest
from made_models import EARLY, EARLY_SETTINGS, made_model

import hydroid
from hydroid.errors import HydroidError
from hydroid.findings import Finding
from hydroid.identified_model import IdentifiedModel
from hydroid.joint_verdict import JointVerdict, Verdict
from hydroid.log import Log, write_log
from hydroid.plant import Limit, Plant
from hydroid.use.follow import follow, joint_lags

JOINTS = {"shoulder": 1, "elbow": 2}


def model(kind="quasi-static", **hydraulics) -> IdentifiedModel:
    changes = {"simulation.model": kind, "outputs": [2, 3]}
    return made_model(EARLY, changes, hydraulics=EARLY_SETTINGS | hydraulics)


def path(one: IdentifiedModel, speed=0.05, seconds=6.0, rest=0.5, joints=JOINTS) -> Log:
    """Half waves of some joints, after a rest; `speed` [rad/s] is the largest."""
    period = one.settings.log.period_s
    time = np.arange(round(seconds / period)) * period
    angle = np.tile(one.settings.arm.pose(one.settings.start_pose), (len(time), 1))
    turn = 2 * np.pi / (seconds - rest) * np.maximum(time - rest, 0.0)
    for joint in joints.values():
        angle[:, joint] += (
            0.5 * speed * (seconds - rest) / (2 * np.pi) * (1 - np.cos(turn))
        )
    return Log("path", time, np.zeros_like(angle), angle, period)


@pytest.mark.parametrize("kind", ["quasi-static", "dynamic"])
@pytest.mark.parametrize(
    "values",
    [
        {},
        {
            "dead_band_a": 20.0,
            "dead_band_b": 15.0,
            "pilot_lag_a": 0.1,
            "pilot_lag_b": 0.1,
        },
        {"opening_lag": 0.15, "opening_exponent_a": 1.7, "pump_flow": 5.0},
    ],
)
def test_the_commands_lead_the_model_along_the_path(kind, values):
    one = model(kind, **values)
    wished = path(one)
    found = follow(one, wished)
    assert not found.missed
    plant = Plant(one)
    angle = [plant.reset(wished.start)]
    for command in found.log.command[:-1]:
        angle.append(plant.step(command))
    np.testing.assert_array_equal(angle, found.angle)  # as predicted, to the bit
    travel = np.ptp(wished.angle, axis=0)
    for joint in JOINTS.values():
        assert found.rms(joint + 1)[0] < 0.01 * travel[joint]
    assert not found.log.command[:, [0, 3, 4, 5, 6]].any()


def test_commands_come_before_the_motion_by_delay_and_lags():
    """A path that begins at once begins later than its commands, by what the joints are
    late."""
    early = path(one := model(), rest=0.0)
    late_model = model(opening_lag=0.2)
    first, second = follow(one, early), follow(late_model, early)
    lags = joint_lags(Plant(one))
    assert lags[1] >= 0.05  # the delay of the shoulder alone
    assert first.lead_s >= lags.max()
    assert second.lead_s - first.lead_s == pytest.approx(0.2, abs=2 * early.period)
    assert follow(one, path(one, rest=1.0)).lead_s == 0.0
    np.testing.assert_array_equal(first.log.angle[-len(early.time) :], early.angle)


@pytest.mark.parametrize("kind", ["quasi-static", "dynamic"])
def test_a_joint_gets_no_command_before_its_motion_asks_for_one(kind):
    """What is learnt comes through a filter that looks ahead: nothing of it may come
    before the lags do."""
    one = model(kind, opening_lag=0.2, pump_flow=5.0)
    lags = joint_lags(Plant(one))
    found = follow(one, path(one, rest=2.0))
    for joint in JOINTS.values():
        command = found.log.command[:, joint]
        moves = np.flatnonzero(np.diff(found.log.angle[:, joint]))[0]
        first = np.flatnonzero(command)[0]
        assert (moves - first) * found.log.period <= lags[joint] + found.log.period
        # the path begins upwards
        assert command[first : moves + 50].min() > -0.1 * command.max()


def test_lifting_takes_more_command_than_lowering():
    one = model()
    found = follow(one, path(one, joints={"shoulder": 1}))
    command, speed = found.log.command[:, 1], np.gradient(found.angle[:, 1])
    there, back = command[speed > 0.8 * speed.max()], command[speed < 0.8 * speed.min()]
    assert abs(there.mean() + back.mean()) > 0.02 * abs(there.mean() - back.mean())


def test_what_cannot_be_had_is_named_and_the_nearest_taken():
    one = model()
    fast = follow(one, path(one, speed=2.0, seconds=1.5, joints={"elbow": 2}))
    assert {(missed.joint, missed.limit) for missed in fast.missed} == {(2, Limit.FULL)}
    assert np.abs(fast.log.command).max() == 100.0
    assert all(abs(missed.had) < abs(missed.wished) for missed in fast.missed)
    beyond = path(one, speed=0.05, joints={"elbow": 2})
    arm = one.settings.arm
    beyond.angle[:, 2] += arm.upper[2] - beyond.angle[:, 2].max() + 0.01
    found = follow(one, beyond)
    assert Limit.STOP in {missed.limit for missed in found.missed}
    assert found.angle[:, 2].max() <= arm.upper[2] + 1e-3


@pytest.mark.parametrize("kind", ["quasi-static", "dynamic"])
def test_a_joint_that_falls_behind_catches_up(kind):
    """It is asked for more than its valve gives, there and back, and then rests where
    it should."""
    one = model(kind)
    fast = path(one, speed=2.0, seconds=1.5, joints={"elbow": 2})
    still = round(3.0 / fast.period)
    angle = np.concatenate([fast.angle, np.tile(fast.angle[-1], (still, 1))])
    time = np.arange(len(angle)) * fast.period
    found = follow(one, Log("path", time, np.zeros_like(angle), angle, fast.period))
    assert {missed.limit for missed in found.missed} == {Limit.FULL}
    away = np.degrees(np.abs(found.error(3)))
    assert away.max() > 5.0
    assert away[-1] < 0.05


def test_the_command_line_writes_a_log_that_simulates_to_the_path(tmp_path: Path):
    one = model()
    settings = one.settings
    wished = path(one)
    write_log(tmp_path / "path.csv", wished, settings.log)
    out = tmp_path / "out" / "commands.csv"
    result = hydroid.follow(tmp_path / "path.csv", fit=one, out=out)
    assert {file.name for file in out.parent.iterdir()} == {
        "commands.csv",
        "commands.html",
        "tables",
    }
    again = hydroid.simulate(out, fit=one).log
    np.testing.assert_allclose(
        again.angle[:, [1, 2]], wished.angle[:, [1, 2]], atol=np.radians(0.1)
    )
    # as a log and as a file it starts where the path begins, to the last digit written
    for commands in (out, result.result.log):
        played = hydroid.simulate(commands, fit=one).log
        np.testing.assert_allclose(
            played.angle[:, [1, 2]], result.result.angle[:, [1, 2]], atol=1e-6
        )
    rows = result.plain()["joints"]
    assert [row["name"] for row in rows] == ["shoulder", "elbow"]
    assert max(row["rms_deg"] for row in rows) < 0.1
    assert "shoulder" in result._repr_html_()


def test_a_joint_without_a_column_rests_and_a_misspelt_one_is_named(tmp_path: Path):
    """Also where the settings map each joint to a column of its own, as those of
    `hydroid init` do."""
    urdf = Path(__file__).parents[2] / "examples" / "urdf"
    hydroid.init(tmp_path / "mine", arm=urdf / "robot.urdf", log=[urdf / "log_1.csv"])
    one = hydroid.load_plant(tmp_path / "mine" / "fit.yaml").identified
    settings = one.settings
    wished = path(one, seconds=3.0, joints={"boom": 1})
    write_log(tmp_path / "whole.csv", wished, settings.log)
    mapped = settings.log.columns("angle", 2)
    assert mapped is not None
    own = [settings.log.time.column, mapped.column[0]]
    whole = pandas.read_csv(tmp_path / "whole.csv")[own]
    whole.to_csv(tmp_path / "boom.csv", index=False)
    whole.rename(columns={own[1]: "elbwo"}).to_csv(tmp_path / "elbwo.csv", index=False)
    found = hydroid.follow(tmp_path / "boom.csv", fit=one).result
    moved = np.ptp(found.log.angle, axis=0)
    assert moved[1] == pytest.approx(np.ptp(wished.angle[:, 1]), rel=1e-6)
    assert not np.delete(moved, 1).any()
    with pytest.raises(HydroidError, match="columns without a use: elbwo"):
        hydroid.follow(tmp_path / "elbwo.csv", fit=one)


CRANE = """<robot name="crane"><link name="base"/>
<link name="boom"><inertial><origin xyz="1 0 0"/><mass value="200"/>
  <inertia ixx="9" iyy="80" izz="80" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="rod"><inertial><origin xyz="1 0 0"/><mass value="60"/>
  <inertia ixx="2" iyy="20" izz="20" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="lift" type="revolute"><parent link="base"/><child link="boom"/>
  <axis xyz="0 -1 0"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
<joint name="telescope" type="prismatic"><parent link="boom"/><child link="rod"/>
  <axis xyz="1 0 0"/><limit lower="0" upper="1.5" effort="1" velocity="1"/></joint>
</robot>"""


def test_errors_of_a_joint_that_slides_are_in_mm(tmp_path: Path):
    (tmp_path / "crane.urdf").write_text(CRANE)
    hydroid.init(tmp_path / "mine", arm=tmp_path / "crane.urdf")
    one = hydroid.load_plant(tmp_path / "mine" / "fit.yaml").identified
    found = hydroid.follow(path(one, joints={"telescope": 1}), fit=one)
    turning, sliding = found.plain()["joints"]
    assert {"rms_deg", "rms_with_band_deg"} < turning.keys()
    assert {"rms_mm", "rms_with_band_mm"} < sliding.keys()
    assert sliding["rms_mm"] == pytest.approx(1e3 * found.result.rms(2)[0])
    assert sliding["rms_mm"] > 0.0


@pytest.mark.parametrize(
    ("refused", "says"),
    [
        (lambda one: path(one, joints={"azimuth": 0}), "azimuth should move"),
        (lambda one: path(one).part(0, 2), "no path"),
    ],
)
def test_a_path_that_is_none_is_refused(refused, says):
    one = model()
    with pytest.raises(HydroidError, match=says):
        hydroid.follow(refused(one), fit=one)


def test_a_fit_of_stage_1_is_refused():
    mech = made_model(EARLY, stage="mech")
    with pytest.raises(HydroidError, match="stage 2"):
        hydroid.follow(path(model()), fit=mech)


def judged(joint: int, name: str, verdict: Verdict, unseen: float | None = None):
    """A verdict on a joint, by an unseen log where it has an error there [deg]."""
    ahead = {"the fit": (0.1, 0.2, 0.3, 0.4, 0.5)} if unseen else {}
    return JointVerdict(
        joint=joint,
        name=name,
        verdict=verdict,
        fitted_deg=0.1,
        unseen_deg=unseen,
        unseen_logs=1 if unseen else 0,
        tolerance_deg=1.0,
        horizons_deg=ahead,
    )


def fitted_model(*verdicts: JointVerdict, findings: Sequence[Finding] = ()):
    return replace(
        (one := model()),
        summary=one.summarise().changed({"verdict": verdicts, "findings": findings}),
    )


def test_what_may_lead_the_machine_off_its_path_is_said_first():
    """A joint that stands is no danger, and one that predicts no doubt."""
    failing = judged(2, "shoulder", Verdict.WORSE_THAN_FITTED, 2.0)
    one = fitted_model(
        failing,
        judged(3, "elbow", Verdict.UNTESTED),
        findings=[Finding("time up", "warning"), Finding("error lasts", "note")],
    )
    found = hydroid.follow(path(one, seconds=3.0), fit=one)
    stopped, unproven = map(str, found.lines[1:3])
    assert stopped.startswith("The time for the fit was up before it had converged.")
    judgement = (
        "shoulder (predicts 20 times worse than it fits) and elbow (not tested)."
    )
    assert judgement in unproven
    kinds = [finding["kind"] for finding in found.plain()["findings"]]
    assert kinds == ["time up", "path not proven"]
    proven = fitted_model(judged(2, "shoulder", Verdict.PREDICTS, 0.5))
    alone = path(proven, seconds=3.0, joints={"shoulder": 1})
    assert hydroid.follow(alone, fit=proven).plain()["findings"] == []
    # of a model that no fit made, nothing is known
    bare = model()
    (said,) = hydroid.follow(path(bare, seconds=3.0), fit=bare).plain()["findings"]
    assert said["details"] == {"shoulder": "not tested", "elbow": "not tested"}


@pytest.mark.parametrize(
    ("seconds", "says"),
    [(4.5, "after 5 s was 0.4 deg"), (12.0, "over whole logs was 2 deg")],
)
def test_the_error_on_unseen_logs_is_that_over_as_long_as_the_path(seconds, says):
    one = fitted_model(judged(2, "shoulder", Verdict.ROUGHLY, 2.0))
    wished = path(one, seconds=seconds, joints={"shoulder": 1})
    lines = [str(line) for line in hydroid.follow(wished, fit=one).lines]
    assert f"On unseen logs the rms error {says} (shoulder)." in lines
