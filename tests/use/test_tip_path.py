"""A path of the tip becomes joint angles whose forward kinematics are the path."""

from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
from made_models import EARLY, EARLY_SETTINGS, made_model

import hydroid
from hydroid.errors import LogError
from hydroid.identified_model import IdentifiedModel, identified
from hydroid.joint_verdict import JointVerdict, Verdict
from hydroid.use.tip_path import TipKinematics


def model() -> IdentifiedModel:
    """Shoulder and elbow with hydraulics, and little friction; by the model that takes
    least time, since paths of the tip are the same for all."""
    changes = {"outputs": [2, 3], "simulation.model": "quasi-static"}
    return made_model(EARLY, changes, hydraulics=EARLY_SETTINGS)


def forward(arm, angle):
    """Where the payload's site is [m], by MuJoCo alone."""
    assert arm.payload is not None
    mjcf = mujoco.MjModel.from_xml_path(str(arm.model))
    data = mujoco.MjData(mjcf)
    data.qpos[:] = angle
    mujoco.mj_kinematics(mjcf, data)
    return data.site(arm.payload).xpos.copy()


def line(start, by, seconds=4.0, rows=101):
    """A straight line [s, m, m, m], at rest at both ends."""
    time = np.linspace(0.0, seconds, rows)
    part = 0.5 - 0.5 * np.cos(np.pi * time / seconds)
    return np.column_stack([time, start + part[:, None] * np.array(by)])


def write(path: Path, rows, header="time_s,x_m,y_m,z_m") -> Path:
    np.savetxt(path, rows, delimiter=",", header=header, comments="")
    return path


@pytest.mark.parametrize("by", [[0.05, 0.0, 0.05], [-0.1, 0.0, 0.1], [0.0, 0.0, -0.1]])
def test_the_tip_is_where_the_path_is(by):
    one = model()
    arm, start = one.settings.arm, one.settings.arm.pose("study")
    points = line(forward(arm, start), by)[:, 1:]
    angle, off = TipKinematics(arm, [2, 3]).angles(points, start)
    np.testing.assert_allclose(
        [forward(arm, pose) for pose in angle], points, atol=1e-5
    )
    assert off.max() < 1e-5
    assert np.all((angle >= arm.lower) & (angle <= arm.upper))
    np.testing.assert_array_equal(
        np.delete(angle, [1, 2], axis=1), np.delete(np.tile(start, (101, 1)), [1, 2], 1)
    )
    # no jump between two samples
    assert np.abs(np.diff(angle, axis=0)).max() < np.radians(5.0)


def test_with_more_joints_than_needed_angles_return_to_where_they_began():
    """A still path keeps the pose: of many poses that reach a point, the one before is
    taken."""
    one = model()
    arm, start = one.settings.arm, one.settings.arm.pose("study")
    points = np.tile(forward(arm, start), (5, 1))
    angle, _ = TipKinematics(arm, range(1, 8)).angles(points, start)
    np.testing.assert_allclose(angle, np.tile(start, (5, 1)), atol=1e-6)


def test_commands_lead_the_tip_along_a_line(tmp_path: Path):
    one = model()
    arm, start = one.settings.arm, one.settings.arm.pose("study")
    wished = line(forward(arm, start), [0.03, 0.0, 0.05], seconds=6.0)
    file = write(tmp_path / "tip.csv", wished)
    hydroid.follow(file, fit=one, out=tmp_path / "commands.csv")
    played = hydroid.simulate(tmp_path / "commands.csv", fit=one).log
    end = forward(arm, played.angle[-1])
    np.testing.assert_allclose(end, wished[-1, 1:], atol=2e-3)


def test_an_arm_without_a_site_is_led_by_the_end_of_its_last_link(tmp_path: Path):
    one = model()
    settings = one.settings.changed({"arm.payload": None, "outputs": [2, 3]})
    bare = identified(settings, one.values, "test")
    arm, start = settings.arm, settings.arm.pose("study")
    tip = TipKinematics(arm, [2, 3])
    wished = line(tip.place(start), [0.03, 0.0, 0.05], seconds=6.0)
    file = write(tmp_path / "tip.csv", wished)
    followed = hydroid.follow(file, fit=bare, out=tmp_path / "commands.csv")
    assert followed.content["tip"] == "the end of jaw_left"
    (line_,) = [one for one in followed.lines if str(one).startswith("The tip is ")]
    away = followed.content["tip_away_mm"]
    place = tip.place(start)
    assert line_ == (
        f"The tip is the end of jaw_left. It starts at x {place[0]:.3f}, y {place[1]:.3f}, "
        f"z {place[2]:.3f} m. By the model it stays within {away:.3g} mm of where "
        "it should be at each time."
    )
    along = followed.result
    wish = np.array([tip.place(pose) for pose in along.log.angle])
    had = np.array([tip.place(pose) for pose in along.angle])
    off = np.linalg.norm(wish - had, axis=1)
    assert away == pytest.approx(1e3 * off.max())
    assert 0.0 < away < 5.0
    played = hydroid.simulate(tmp_path / "commands.csv", fit=bare).log
    np.testing.assert_allclose(tip.place(played.angle[-1]), wished[-1, 1:], atol=2e-3)


@pytest.mark.parametrize("relative", [True, False])
@pytest.mark.parametrize(
    ("time", "unit", "factor"), [("time_s", "s", 1.0), ("t", "ms", 1e3)]
)
def test_a_path_counts_from_the_start_or_from_the_base_in_the_logs_time_or_seconds(
    tmp_path: Path, relative: bool, time: str, unit: str, factor: float
):
    changes = {"outputs": [2, 3], "log.time": {"column": "t", "unit": unit}}
    one = made_model(EARLY, changes, hydraulics=EARLY_SETTINGS)
    arm, start = one.settings.arm, one.settings.arm.pose("study")
    place, by = forward(arm, start), np.array([0.03, 0.0, 0.05])
    rows = line(0.0 * place if relative else place, by, seconds=6.0)
    rows[:, 0] *= factor if time == "t" else 1.0
    names = "dx_m,dy_m,dz_m" if relative else "x_m,y_m,z_m"
    file = write(tmp_path / "tip.csv", rows, f"{time},{names}")
    path = hydroid.follow(file, fit=one).result.log
    assert path.time[-1] == pytest.approx(6.0, abs=0.3)
    np.testing.assert_allclose(forward(arm, path.angle[0]), place, atol=1e-5)
    np.testing.assert_allclose(forward(arm, path.angle[-1]), place + by, atol=1e-5)


def beyond(place):
    return line(place, [5.0, 0.0, 0.0])


def backwards(place):
    rows = line(place, [0.03, 0.0, 0.0])
    rows[3, 0] = 0.0
    return rows


def without_number(place):
    rows = line(place, [0.03, 0.0, 0.0])
    rows[4, 2] = np.nan
    return rows


def endless(place):
    rows = line(place, [0.03, 0.0, 0.0])
    rows[-1, 0] = 1e16
    return rows


@pytest.mark.parametrize(
    ("rows", "header", "says"),
    [
        (
            endless,
            "time_s,x_m,y_m,z_m",
            r"line \d+, column time_s: the path lasts 1e\+16 s",
        ),
        (
            beyond,
            "time_s,x_m,y_m,z_m",
            r"cannot reach x .* at 4 s: it stays 4\.\d+ m away",
        ),
        (
            backwards,
            "time_s,x_m,y_m,z_m",
            "line 5, column time_s: times do not increase",
        ),
        (without_number, "time_s,x_m,y_m,z_m", "line 6, column y_m: holds no number"),
        (beyond, "time_s,x_m,y_m,height", "column z_m is missing"),
        (beyond, "time_s,dx_m,dy_m,height", "column dz_m is missing"),
        (beyond, "seconds,x_m,y_m,z_m", "column time_s is missing"),
        (beyond, "time_s,dx,dy,dz", "column dx has no unit; .* takes dx_m, dy_m"),
    ],
)
def test_a_path_that_cannot_be_followed_is_refused_in_one_line(
    tmp_path: Path, rows, header, says
):
    one = model()
    place = forward(one.settings.arm, one.settings.arm.pose("study"))
    file = write(tmp_path / "tip.csv", rows(place), header)
    with pytest.raises(LogError, match=says):
        hydroid.follow(file, fit=one, out=tmp_path / "commands.csv")
    assert not (tmp_path / "commands.csv").exists()


def test_the_error_on_unseen_logs_is_told_where_the_tip_is(tmp_path: Path):
    """An error of the shoulder alone leads the tip away along its circle."""
    one = model()
    error = 0.5
    verdicts = [
        JointVerdict(
            joint=joint,
            name=name,
            verdict=Verdict.PREDICTS,
            unseen_deg=size,
            unseen_logs=1,
            tolerance_deg=1.0,
        )
        for joint, name, size in [(2, "shoulder", error), (3, "elbow", 0.0)]
    ]
    known = replace(one, summary=one.summarise().changed({"verdict": verdicts}))
    arm, start = one.settings.arm, one.settings.arm.pose("study")
    wished = line(forward(arm, start), [0.03, 0.0, 0.05], seconds=6.0)
    followed = hydroid.follow(write(tmp_path / "tip.csv", wished), fit=known)
    tip = TipKinematics(arm, [2, 3])
    off = []
    for angle in followed.result.log.angle:
        turned = angle.copy()
        turned[1] += np.radians(error)
        off.append(np.linalg.norm(tip.place(turned) - tip.place(angle)))
    (said,) = [one for one in map(str, followed.lines) if "unseen logs" in one]
    assert said == (
        "On unseen logs the rms error over whole logs was 0.5 deg (shoulder) and 0 deg "
        f"(elbow), which is up to {1e3 * max(off):.2g} mm at the tip."
    )
