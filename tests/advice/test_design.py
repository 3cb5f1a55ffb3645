"""The designed experiment: its limits, its information, and the search, held to laws."""

from dataclasses import replace

import numpy as np
import pytest

from hydroid import load_settings
from hydroid.advice.commands import limited, violation
from hydroid.advice.design import Design, design
from hydroid.advice.information import ExperimentSimulator, Precision, log_information, sensor_noise
from hydroid.arm.machine import load_machine
from hydroid.errors import SettingsError
from hydroid.prediction import simulate_log
from hydroid.problem.problem import Problem
from hydroid.report.design_report import design_table
from hydroid.settings.arm import Arm
from hydroid.settings.experiment import DesignSettings
from hydroid.settings.fit import FitSettings

TRUTH = {"K": 0.2, "D": 231.8, "S": 53.4, "M1": 4.6, "M2": 5.1, "M3": 22.5, "M4": 1.6, "M5": 4.0, "M6": 4.7}
THETA = np.array(list(TRUTH.values()))
DESIGN = {"duration_s": 6, "candidates": 4, "improvements": 8, "dwell_s": [0.5, 2], "poses": "any"}
TWO = {"outputs": [2, 3], "simulation.other_joints": "locked"} | {
    f"parameters.{name}.fixed": TRUTH[name] for name in ("M1", "M4", "M5")
}


def configured(**changes: object) -> FitSettings:
    return load_settings("article-mech", TWO | {"design": DESIGN | changes})


@pytest.fixture(scope="module")
def designed() -> tuple[FitSettings, Design]:
    settings = configured()
    return settings, design(settings, THETA, [], 3)


def keeps_limits(settings: FitSettings, result: Design) -> bool:
    """Whether `simulate` gives the predicted motion, within the limits, after a rest, and without jumps."""
    run, limits = simulate_log(settings, result.log, TRUTH, "truth"), settings.design
    rest = round(limits.rest_s / result.period)
    assert not run.command[:rest].any()
    assert limits.slew_pct_s is not None
    change = np.abs(np.diff(run.command, axis=0, prepend=0.0)).max()
    assert 0 < change <= limits.slew_pct_s * result.period + 1e-9
    assert limits.clearance_m is not None
    assert clearance(settings, run.angle).min() >= limits.clearance_m
    assert np.abs(run.angle - result.best.log.angle).max() < 1e-9
    assert np.abs(run.command).max() <= settings.design.command_pct
    return violation(run.angle, result.period, settings.arm, settings.design) is None


def clearance(settings: FitSettings, angle: np.ndarray) -> np.ndarray:
    """Distance [m] of the right arm from itself, the floor, the carrier and the left arm, shape (T,)."""
    machine = load_machine(settings.arm, pair=True)
    motion = machine.joined({"right": angle}, settings.arm.pose(settings.start_pose))
    return machine.checker.clearance(np.arange(len(angle), dtype=float), motion).distance


def test_experiments_keep_clear_where_others_collide():
    """Of random experiments from random poses some collide, unless they are checked."""
    smallest: list[list[float]] = []
    for margin in (0.05, None):
        settings = configured(clearance_m=margin, candidates=8, improvements=0, duration_s=4)
        tried = design(settings, THETA, [], 1).random
        smallest.append([clearance(settings, trial.log.angle).min() for trial in tried])
    checked, unchecked = smallest
    assert min(checked) >= 0.05
    assert min(unchecked) < 0
    assert len(checked) >= 3


def test_a_limited_command_rises_at_its_rate_and_arrives():
    start = np.array([10, 40])
    jumps = np.zeros(60)
    jumps[10:40], jumps[40:] = 50.0, -20.0
    slow = limited(jumps, start, 5.0)
    assert np.abs(np.diff(slow)).max() == pytest.approx(5.0)
    assert slow[:10] == pytest.approx(np.zeros(10))
    assert (slow[10], slow[19], slow[39], slow[53], slow[59]) == pytest.approx((5, 50, 50, -20, -20))
    # it goes on from where it is when it had no time to arrive
    assert limited(jumps, start, 1.0)[[39, 40]] == pytest.approx([30, 29])


def test_a_design_keeps_its_limits_when_simulate_runs_it(designed: tuple[FitSettings, Design]):
    settings, result = designed
    assert keeps_limits(settings, result)
    assert result.log.duration == pytest.approx(6.0)
    for joint, signal in result.best.experiment.inputs.items():
        assert joint in (1, 2)
        assert np.diff(signal.start).min(initial=50) >= 50  # the shortest dwell, 0.5 s


@pytest.mark.parametrize(
    "tight", [{"speed_deg_s": 3}, {"margin_deg": 25, "poses": ["study"]}, {"command_pct": 20}]
)
def test_tight_limits_are_kept_too(tight: dict[str, object]):
    settings = configured(**{"candidates": 2, "improvements": 1} | tight)
    assert keeps_limits(settings, design(settings, THETA, [], 1))


def test_a_violation_is_found_where_it_is(arm: Arm):
    limits = DesignSettings(margin_deg=5, speed_deg_s=10)
    angle = np.tile(arm.pose("study"), (100, 1))
    assert violation(angle, 0.01, arm, limits) is None
    angle[60:, 1] += np.radians(0.11)  # 11 deg/s for one sample
    assert violation(angle, 0.01, arm, limits) == (60, 1, True)


def test_the_best_is_no_worse_than_any_random_one_and_repeats(designed: tuple[FitSettings, Design]):
    settings, result = designed
    weakest = result.precision.weakest(result.best.information)[0]
    assert all(weakest <= result.precision.weakest(t.information)[0] for t in result.random)
    assert weakest < result.random_weakest
    again = design(settings, THETA, [], 3)
    assert np.array_equal(again.log.command, result.log.command)
    assert np.array_equal(again.best.information, result.best.information)
    rows = design_table(settings.design, result, TRUTH).records()
    assert [row["name"] for row in rows] == list(result.names)
    for row in rows:
        assert (row["flag"] != "") == (float(str(row["designed [%]"])) > 30)


def test_information_is_that_of_a_fit_to_the_same_log(designed: tuple[FitSettings, Design]):
    """The search's one-sided differences against the checked central ones; two logs have twice as much."""
    settings, result = designed
    log = simulate_log(settings, result.log, TRUTH, "truth")
    how = settings.objective.model_copy(update={"noise_deg": settings.design.noise_deg})
    given = settings.model_copy(update={"objective": how})
    expected = log_information(Problem(given, [log]), THETA)
    scale = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    assert np.abs(result.best.information - expected).max() < 5e-3 * scale.max()
    ratio = result.precision.deviations(result.best.information) / result.precision.deviations(expected)
    assert ratio == pytest.approx(np.ones(len(ratio)), rel=0.02)
    two = log_information(Problem(given, [log, log]), THETA)
    assert two == pytest.approx(2 * expected, rel=1e-6, abs=1e-6 * np.trace(expected))


def test_earlier_logs_make_every_parameter_more_precise(designed: tuple[FitSettings, Design]):
    settings, result = designed
    log = simulate_log(settings, result.log, TRUTH, "truth")
    few = settings.design.model_copy(update={"candidates": 2, "improvements": 0})
    known = design(settings.model_copy(update={"design": few}), THETA, [log], 4)
    assert not np.array_equal(known.log.command, result.log.command)  # another seed
    assert np.all(known.precision.deviations() < result.precision.deviations())


def test_more_time_never_loses_information(designed: tuple[FitSettings, Design]):
    settings, result = designed
    before = np.zeros((6, 6))
    for samples in (200, 400, 601):
        shorter = settings.design.model_copy(update={"duration_s": (samples - 1) * result.period})
        inputs = {
            joint: replace(signal, start=signal.start[kept], level=signal.level[kept])
            for joint, signal in result.best.experiment.inputs.items()
            for kept in [signal.start < samples]
        }
        simulator = ExperimentSimulator(settings.model_copy(update={"design": shorter}), THETA)
        after = simulator.information(replace(result.best.experiment, inputs=inputs))
        assert after is not None
        assert np.linalg.eigvalsh(after - before).min() > -1e-6 * np.trace(after)
        before = after


def test_noise_of_a_short_correlation_time_is_white():
    rows = np.random.default_rng(0).normal(size=(3, 500))
    white = sensor_noise(DesignSettings(noise_deg=0.1), 500, 0.01).whitened(rows)
    short = sensor_noise(DesignSettings(noise_deg=0.1, noise_correlation_s=1e-4), 500, 0.01)
    assert short.whitened(rows) == pytest.approx(white, rel=1e-6)
    # the closed form of a first-order autoregression
    phi = np.exp(-0.1)
    slow = sensor_noise(DesignSettings(noise_deg=0.1, noise_correlation_s=0.1), 500, 0.01)
    expected = (rows[:, 1:] - phi * rows[:, :-1]) / np.sqrt(1 - phi**2) / np.radians(0.1)
    assert slow.whitened(rows)[:, 1:] == pytest.approx(expected)


def test_null_directions_neither_hide_the_others_nor_look_known():
    told = np.diag([100.0, 4.0, 0.0])
    precision = Precision.of(np.zeros((3, 3)), told)
    assert precision.directions.shape == (3, 2)
    assert precision.deviations(told) == pytest.approx([1 / np.sqrt(101), 1 / np.sqrt(5), 1.0])
    weakest, direction = precision.weakest(told)
    assert weakest == pytest.approx(1 / np.sqrt(5))
    assert np.abs(direction) == pytest.approx([0, 1, 0], abs=1e-12)
    better = np.diag([100.0, 9.0, 0.0])
    for criterion in ("D", "E"):
        assert precision.score(better, criterion) > precision.score(told, criterion)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"joints": [9]}, "joints 1 to 7"),
        ({"poses": ["asleep"]}, "no pose 'asleep'"),
        ({"poses": ["home"]}, "no pose of home is 5 deg inside"),
        ({"margin_deg": 70}, "none of 4 random experiments keeps the limits"),
    ],
)
def test_a_design_that_cannot_be_made_is_refused(changes: dict[str, object], message: str):
    with pytest.raises(SettingsError, match=message):
        design(configured(**changes), THETA, [], 1)
