"""The arm in motion: what is shown is the plant, at the pace of the clock."""

import io
import time
from dataclasses import replace
from itertools import count
from typing import Any

import mujoco
import numpy as np
import pytest
from made_logs import step_log
from PIL import Image

from hydroid.errors import RunError, SettingsError
from hydroid.identified_model import IdentifiedModel, load_identified
from hydroid.log import Log
from hydroid.plant import Plant
from hydroid.reporting.outlines import sight
from hydroid.viewer import film
from hydroid.viewer.film import LONGEST_WAIT, play, rendered
from hydroid.viewer.motion import Motion, Replay, Sliders, simulated_motion

SHOULDER = 1


@pytest.fixture(scope="module")
def nominal() -> IdentifiedModel:
    """With the article's damper and spring; without one, oil and arm would ring on."""
    return load_identified(None, "article-hyd", {"start_pose": "study"}, nominal=True)


@pytest.fixture(scope="module")
def plant(nominal: IdentifiedModel) -> Plant:
    return Plant(nominal, joints=range(1, 8))


@pytest.fixture
def slide(plant: Plant) -> Sliders:
    return Sliders(plant)


class FakeViewer:
    def __init__(self, playback: Any, pictures: int) -> None:
        self.playback, self.left = playback, pictures
        self.times = list[float]()
        self.user_scn = mujoco.MjvScene(playback.model, 1000)
        self.cam = mujoco.MjvCamera()

    def is_running(self) -> bool:
        self.left -= 1
        return self.left >= 0

    def sync(self) -> None:
        self.times.append(self.playback.time)


def played(playback: Any, pictures: int, cost: float = 0.0) -> FakeViewer:
    """Some pictures of a playback; time passes in sleep, and in `cost` seconds of work
    a look."""
    viewer, looks, slept = FakeViewer(playback, pictures), count(), list[float]()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            time, "perf_counter", lambda: 100.0 + cost * next(looks) + sum(slept)
        )
        patch.setattr(time, "sleep", slept.append)
        play(playback, viewer)
    return viewer


def test_a_log_is_shown_as_the_plant_steps(nominal: IdentifiedModel, study_log: Log):
    plant = Plant(nominal)
    expected = [plant.reset(study_log.start)] + [
        plant.step(u) for u in study_log.command[:-1]
    ]
    shown = Replay(simulated_motion(nominal, {"alone": study_log}))
    for moment in (0.013, 0.5, 0.5, 1.23, 99.0):  # whatever the pace
        shown.advance(moment)
        sample = round(shown.time / study_log.period)
        assert sample == min(int(moment / study_log.period), len(expected) - 1)
        np.testing.assert_array_equal(shown.data.qpos, expected[sample])
    assert np.ptp(np.array(expected)[:, SHOULDER]) > 0.05  # it does move


def test_a_slider_moves_its_joint(slide: Sliders):
    start = slide.plant.angle
    slide.plant.data.ctrl[SHOULDER] = 60.0
    slide.advance(1.0)
    moved = slide.plant.angle - start
    assert moved[SHOULDER] > np.radians(5)
    assert np.abs(np.delete(moved, SHOULDER)).max() < 0.1 * moved[SHOULDER]


def test_the_picture_keeps_pace_with_the_clock(slide: Sliders):
    viewer = played(slide, 30)
    assert viewer.times[0] == 0.0
    # 30 pictures, 29 pauses between them, and at most one step behind
    assert viewer.times[-1] == pytest.approx(29 / 60, abs=0.0101)
    assert np.all(np.diff(viewer.times) < 0.021)


def test_a_slow_machine_shows_slow_motion_without_jumps(slide: Sliders):
    viewer = played(slide, 5, cost=0.5)
    assert np.diff(viewer.times) == pytest.approx(LONGEST_WAIT, abs=0.011)


def pictures(motion: Motion, *times: float) -> list[Any]:
    """Small ones where this machine has OpenGL without a display; otherwise the test is
    skipped."""
    try:
        return [*rendered(motion, (480, 270), ((time, "2.0 s") for time in times))]
    except RunError as error:
        if "no picture can be rendered" not in str(error):
            raise
        pytest.skip(str(error))


def test_the_picture_shows_arm_and_ghost_in_full_and_moves(
    nominal: IdentifiedModel, study_log: Log
):
    bent = study_log.angle.copy()
    bent[:, SHOULDER] += np.radians(30) * study_log.time / study_log.time[-1]
    motion = simulated_motion(nominal, {"alone": replace(study_log, angle=bent)})
    assert motion.measured is not None
    first, last = (picture.astype(float) for picture in pictures(motion, 0.0, 5.0))
    assert last.shape == (270, 480, 3)
    assert np.abs(first - last).max() > 50  # the arm has moved
    blue = last[..., 2] - last[..., 0]
    orange = last[..., 0] - last[..., 2]
    for color in (blue, orange):  # both are there, and inside the picture
        seen = np.argwhere(color > 60)
        assert len(seen) > 100
        assert seen.min() > 2
        assert (seen.max(axis=0) < np.array(last.shape[:2]) - 3).all()


@pytest.mark.parametrize("kind", [".gif", ".mp4", ".png"])
def test_every_kind_of_file_is_written(
    nominal: IdentifiedModel, study_log: Log, kind, monkeypatch
):
    av: Any = pytest.importorskip("av") if kind == ".mp4" else None
    motion = simulated_motion(nominal, {"alone": study_log})
    pictures(motion)
    rate = film.KINDS[kind][1]
    monkeypatch.setitem(film.KINDS, kind, ((480, 270), rate))
    content = film.render_motion(motion, kind, (1.0, 1.5))
    if kind == ".mp4":
        with av.open(io.BytesIO(content)) as file:
            assert sum(1 for _ in file.decode(video=0)) == round(0.5 * rate)
        return
    with Image.open(io.BytesIO(content)) as picture:
        assert picture.format == kind[1:].upper()
        assert kind == ".png" or picture.n_frames == round(0.5 * rate)


def test_what_cannot_be_shown_is_refused(nominal: IdentifiedModel, study_log: Log):
    motion = simulated_motion(nominal, {"alone": study_log})
    with pytest.raises(SettingsError, match=r"9:12 s is empty.*ends at 4\.99 s"):
        film.render_motion(motion, ".png", (9.0, 12.0))
    with pytest.raises(SettingsError, match="commands nothing"):
        simulated_motion(nominal, {"alone": step_log(study_log.start, [0.0])})


def test_the_machine_stays_in_the_frame_wherever_it_slews(
    nominal: IdentifiedModel, study_log: Log
):
    """By the camera's law: what is seen lies within half its angle of its axis, from
    where it stands."""
    turned = study_log.angle.copy()
    turned[:, 0] += np.radians(160) * study_log.time / study_log.time[-1]
    motion = simulated_motion(nominal, {"alone": replace(study_log, angle=turned)})
    replay = Replay(motion)
    camera = mujoco.MjvCamera()
    film.look_at(camera, replay.model, replay.region)
    ahead = sight(camera.azimuth, camera.elevation)[2]
    eye = camera.lookat - camera.distance * ahead
    half = np.radians(replay.model.vis.global_.fovy) / 2
    for moment in np.linspace(0.0, replay.duration, 7):
        replay.advance(moment)
        assert replay.ghost is not None
        for data in (replay.data, replay.ghost):
            to = data.xpos[1:] - eye
            away = np.arccos(to @ ahead / np.linalg.norm(to, axis=1))
            assert away.max() < half
