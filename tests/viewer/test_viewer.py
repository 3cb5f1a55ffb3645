"""The arm in motion: what is shown is the plant, at the pace of the clock."""

import io

import numpy as np
import pytest
from conftest import step_log

from hydroid.errors import RunError, SettingsError
from hydroid.identified import IdentifiedModel, load_identified
from hydroid.log import Log
from hydroid.plant import Plant
from hydroid.settings.arm import Arm
from hydroid.viewer.playback import Playback, make_playback
from hydroid.viewer.window import LATE, animation, play

SHOULDER = 1


@pytest.fixture(scope="module")
def nominal() -> IdentifiedModel:
    """With the article's damper and spring; without one, oil and arm would ring on."""
    return load_identified(None, "article-hyd", {"start_pose": "study"}, nominal=True)


@pytest.fixture(scope="module")
def plants(nominal: IdentifiedModel) -> dict[str, Plant]:
    return {"log": Plant(nominal), "sliders": Plant(nominal, joints=range(1, 8))}


@pytest.fixture
def slide(plants: dict[str, Plant]) -> Playback:
    """All joints on sliders, from the study pose."""
    return Playback(plants["sliders"])


class FakeViewer:
    """A window that stays open for some pictures; `at` does what a hand does before the k-th."""

    def __init__(self, playback: Playback, pictures: int, at=lambda k, data: None) -> None:
        self.playback, self.left, self.at = playback, pictures, at
        self.times: list[float] = []
        self.texts: list[tuple] = []

    def is_running(self) -> bool:
        self.left -= 1
        return self.left >= 0

    def set_texts(self, texts) -> None:
        self.texts.append(texts)

    def sync(self) -> None:
        self.times.append(self.playback.plant.time)
        self.at(len(self.times), self.playback.plant.data)


class FakeClock:
    """Time passes in sleep, and in `cost` seconds of work a look."""

    def __init__(self, cost: float = 0.0) -> None:
        self.now, self.cost = 100.0, cost

    def __call__(self) -> float:
        self.now += self.cost
        return self.now

    def sleep(self, seconds: float) -> None:
        self.now += seconds


def test_a_log_is_played_as_the_plant_steps(nominal: IdentifiedModel, plants, study_log: Log):
    plant = Plant(nominal)
    expected = [plant.reset(study_log.start)] + [plant.step(u) for u in study_log.command[:-1]]
    shown = Playback(plants["log"], study_log)
    for moment in (0.013, 0.5, 0.5, 1.23, 99.0):  # whatever the pace
        shown.advance(moment)
        sample = round(shown.plant.time / study_log.period)
        assert sample == min(int(moment / study_log.period), len(expected) - 1)
        np.testing.assert_array_equal(shown.plant.angle, expected[sample])
    assert np.ptp(np.array(expected)[:, SHOULDER]) > 0.05  # it does move


def test_what_is_drawn_stands_where_the_angles_say(slide: Playback, arm: Arm):
    slide.plant.data.ctrl[SHOULDER] = 100.0
    slide.advance(1.0)
    plant = slide.plant
    axis = plant.data.xmat[plant.model.body("link2").id].reshape(3, 3)[:, 0]
    assert np.arcsin(axis[2]) == pytest.approx(plant.angle[SHOULDER], abs=1e-12)


def test_sliders_move_their_joint_and_zero_stops_it(slide: Playback):
    plant = slide.plant
    start = plant.angle
    plant.data.ctrl[SHOULDER] = 60.0
    slide.advance(1.0)
    moved = plant.angle - start
    assert moved[SHOULDER] > np.radians(5)
    assert np.abs(np.delete(moved, SHOULDER)).max() < 0.1 * moved[SHOULDER]
    plant.data.ctrl[SHOULDER] = 0.0
    slide.advance(2.0)
    stopped = plant.angle[SHOULDER]
    slide.advance(3.0)
    assert plant.angle[SHOULDER] == pytest.approx(stopped, abs=np.radians(0.1))


def test_the_picture_keeps_pace_with_the_clock(slide: Playback):
    clock = FakeClock()
    viewer = FakeViewer(slide, 30)
    play(slide, viewer, clock, clock.sleep)
    assert viewer.times[0] == 0.0
    # 30 pictures, 29 pauses between them, and at most one step behind
    assert viewer.times[-1] == pytest.approx(29 / 60, abs=0.0101)
    assert np.all(np.diff(viewer.times) < 0.021)
    (_, _, names, values) = viewer.texts[-1]
    assert names.splitlines()[:3] == ["time", "azimuth", "shoulder"]
    assert values.splitlines()[0] == f"{slide.plant.time:.1f} s"


def test_a_slow_machine_shows_slow_motion_without_jumps(slide: Playback):
    clock = FakeClock(cost=0.5)
    viewer = FakeViewer(slide, 5)
    play(slide, viewer, clock, clock.sleep)
    assert np.diff(viewer.times) == pytest.approx(LATE, abs=0.011)


def test_the_viewers_reset_starts_again(slide: Playback):
    def reset(k, data):
        if k == 10:
            data.time = 0.0
            data.ctrl[:] = 0.0

    start = slide.plant.angle
    slide.plant.data.ctrl[SHOULDER] = 60.0
    clock = FakeClock()
    viewer = FakeViewer(slide, 12, reset)
    play(slide, viewer, clock, clock.sleep)
    assert viewer.times[9] > 0.1 > viewer.times[11]
    assert np.abs(slide.plant.angle - start).max() < 1e-3


def test_a_playback_that_diverges_says_when(slide: Playback):
    slide.plant.data.qpos[0] = np.nan
    with pytest.raises(RunError, match=r"diverged before 0\.01 s"):
        slide.advance(0.02)


def test_a_gif_shows_the_arm_in_motion(nominal: IdentifiedModel, arm: Arm):
    """Rendered without a display, where this machine can."""
    Image = pytest.importorskip("PIL.Image")
    log = step_log(arm.pose("study"), [80.0], dwell=0.61)
    try:
        picture = animation(make_playback(nominal, log))
    except RunError as error:
        if "no picture can be rendered" not in str(error):
            raise
        pytest.skip(str(error))
    with Image.open(io.BytesIO(picture)) as gif:
        assert gif.n_frames == 7
        first = np.asarray(gif.convert("RGB"), float)
        gif.seek(6)
        last = np.asarray(gif.convert("RGB"), float)
    assert np.abs(first - last).max() > 50  # the arm has moved
    assert np.unique(first.reshape(-1, 3), axis=0).shape[0] > 20  # and it is a picture, not one colour


def test_a_log_without_commands_is_refused(nominal: IdentifiedModel, arm: Arm):
    with pytest.raises(SettingsError, match="commands nothing"):
        make_playback(nominal, step_log(arm.pose("study"), [0.0]))
