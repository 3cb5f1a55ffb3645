"""The arm in motion: what is shown is what the simulation does, at the pace of the clock."""

from pathlib import Path

import numpy as np
import pytest

from hydroid.arm.model import load_model
from hydroid.errors import RunError, SettingsError
from hydroid.log import Log
from hydroid.problem.problem import make_simulation
from hydroid.settings.arm import Arm
from hydroid.viewer.choice import Chosen, choose
from hydroid.viewer.player import Player
from hydroid.viewer.window import LATE, play

SHOULDER = 1


@pytest.fixture(scope="module")
def chosen() -> Chosen:
    """The article's damper and spring; without one, oil and arm would ring on."""
    return choose("fit-hyd", None, {"parameters.D.fixed": 231.8, "parameters.S.fixed": 53.4})


def player(arm: Arm, chosen: Chosen, log: Log, outputs: list[int], *, live: bool) -> Player:
    spec = load_model(arm.model, arm)
    return Player(
        spec, arm, make_simulation(spec, log, outputs, chosen.settings), chosen.candidate, log, live=live
    )


@pytest.fixture
def slide(arm: Arm, chosen: Chosen, study_log: Log) -> Player:
    """All joints on sliders, from the study pose."""
    return player(arm, chosen, study_log, list(range(7)), live=True)


class FakeViewer:
    """A window that stays open for some pictures; `at` does what a hand does before the k-th."""

    def __init__(self, player: Player, pictures: int, at=lambda k, data: None) -> None:
        self.player, self.left, self.at = player, pictures, at
        self.times: list[float] = []
        self.texts: list[tuple] = []

    def is_running(self) -> bool:
        self.left -= 1
        return self.left >= 0

    def set_texts(self, texts) -> None:
        self.texts.append(texts)

    def sync(self) -> None:
        self.times.append(self.player.data.time)
        self.at(len(self.times), self.player.data)


class FakeClock:
    """Time passes in sleep, and in `cost` seconds of work a look."""

    def __init__(self, cost: float = 0.0) -> None:
        self.now, self.cost = 100.0, cost

    def __call__(self) -> float:
        self.now += self.cost
        return self.now

    def sleep(self, seconds: float) -> None:
        self.now += seconds


def test_a_log_is_played_as_it_is_simulated(arm: Arm, chosen: Chosen, study_log: Log):
    simulation = make_simulation(load_model(arm.model, arm), study_log, [SHOULDER], chosen.settings)
    expected = simulation.simulate(chosen.candidate).angle[0, :, 0]
    shown = player(arm, chosen, study_log, [SHOULDER], live=False)
    for moment in (0.013, 0.5, 0.5, 1.23, 99.0):  # whatever the pace
        shown.advance(moment)
        sample = round(shown.time / study_log.period)
        assert sample == min(int(moment / study_log.period), len(expected) - 1)
        assert shown.data.qpos[SHOULDER] == expected[sample]
    still = np.delete(shown.data.qpos, SHOULDER)
    assert (still == np.delete(study_log.angle[0], SHOULDER)).all()
    assert np.ptp(expected) > 0.05  # it does move


def test_sliders_move_their_joint_and_zero_stops_it(slide: Player):
    start = slide.data.qpos.copy()
    slide.data.ctrl[SHOULDER] = 60.0
    slide.advance(1.0)
    moved = slide.data.qpos - start
    assert moved[SHOULDER] > np.radians(5)
    assert np.abs(np.delete(moved, SHOULDER)).max() < 0.1 * moved[SHOULDER]
    slide.data.ctrl[SHOULDER] = 0.0
    slide.advance(2.0)
    stopped = slide.data.qpos[SHOULDER]
    slide.advance(3.0)
    assert slide.data.qpos[SHOULDER] == pytest.approx(stopped, abs=np.radians(0.1))


def test_sliders_reach_from_minus_to_plus_100_percent(slide: Player):
    assert slide.model.actuator_ctrllimited.all()
    assert (slide.model.actuator_ctrlrange == [-100.0, 100.0]).all()


def test_the_picture_keeps_pace_with_the_clock(slide: Player):
    clock = FakeClock()
    viewer = FakeViewer(slide, 30)
    play(slide, viewer, clock, clock.sleep)
    assert viewer.times[0] == 0.0
    # 30 pictures, 29 pauses between them, and at most one step behind
    assert viewer.times[-1] == pytest.approx(29 / 60, abs=0.0101)
    assert np.all(np.diff(viewer.times) < 0.021)
    (_, _, names, values) = viewer.texts[-1]
    assert names.splitlines()[:3] == ["time", "azimuth", "shoulder"]
    assert values.splitlines()[0] == f"{slide.time:.1f} s"


def test_a_slow_machine_shows_slow_motion_without_jumps(slide: Player):
    clock = FakeClock(cost=0.5)
    viewer = FakeViewer(slide, 5)
    play(slide, viewer, clock, clock.sleep)
    assert np.diff(viewer.times) == pytest.approx(LATE, abs=0.011)


def test_the_viewers_reset_starts_again(slide: Player):
    def reset(k, data):
        if k == 10:
            data.time = 0.0
            data.ctrl[:] = 0.0

    slide.data.ctrl[SHOULDER] = 60.0
    start = slide.data.qpos.copy()
    clock = FakeClock()
    viewer = FakeViewer(slide, 12, reset)
    play(slide, viewer, clock, clock.sleep)
    assert viewer.times[9] > 0.1 > viewer.times[11]
    assert np.abs(slide.data.qpos - start).max() < 1e-3


def test_a_player_that_diverges_says_when(slide: Player):
    slide._run.position[0, 0] = np.nan
    with pytest.raises(RunError, match=r"diverged before 0\.02 s"):
        slide.advance(0.02)


def test_values_are_taken_and_what_is_not_named_is_nominal(tmp_path: Path, arm: Arm):
    file = tmp_path / "p.yaml"
    file.write_text("A_A: 900\nM3: 20\n")
    found = choose(None, file)
    nominal = choose(None, None).candidate
    assert found.candidate.actuators.area_a[0] == pytest.approx([8e-4, 9e-4, 1e-3, 1e-5, 5e-4, 8e-6, 3e-4])
    assert (found.candidate.actuators.area_b == nominal.actuators.area_b).all()
    assert found.candidate.arm.mass[0] == pytest.approx(np.where(np.arange(8) == 2, 20.0, arm.masses))
    assert (nominal.arm.mass[0] == arm.masses).all()
    assert "A_B" in found.nominal
    assert "A_A" not in found.nominal
    assert choose(None, None, {"parameters.A_A.fixed": 700}).candidate.actuators.area_a[0, 1] == 7e-4


def test_a_name_that_does_not_exist_is_refused(tmp_path: Path):
    file = tmp_path / "p.yaml"
    file.write_text("AA: 900\n")
    with pytest.raises(SettingsError, match="unknown parameter 'AA'"):
        choose(None, file)
