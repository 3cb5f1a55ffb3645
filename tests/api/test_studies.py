"""Sensitivity, error surfaces and designed experiments, held to laws."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from hydroid import load_settings
from hydroid.errors import SettingsError
from hydroid.experiment.design import Design, design
from hydroid.experiment.information import Judge, log_information, sensor_noise
from hydroid.experiment.trial import Bench, violation
from hydroid.log import Log
from hydroid.prediction import simulate_log
from hydroid.problem.problem import Problem
from hydroid.report.design_report import design_table
from hydroid.report.objectives import contours
from hydroid.report.page import write_page
from hydroid.report.sensitivity_report import sensitivity_page
from hydroid.settings.arm import Arm
from hydroid.settings.experiment import DesignSettings
from hydroid.settings.fit import FitSettings
from hydroid.uncertainty.surface import surface
from hydroid.uncertainty.sweep import SWEEP_POINTS, sweep

TRUTH = {
    "K": 0.2,
    "D": 231.8,
    "S": 53.4,
    "M1": 4.6,
    "M2": 5.1,
    "M3": 22.5,
    "M4": 1.6,
    "M5": 4.0,
    "M6": 4.7,
}
THETA = np.array(list(TRUTH.values()))
DESIGN = {"duration_s": 6, "candidates": 4, "improvements": 8, "dwell_s": [0.5, 2], "poses": "any"}
TWO = {"outputs": [2, 3], "simulation.other_joints": "locked"} | {
    f"parameters.{name}.fixed": TRUTH[name] for name in ("M1", "M4", "M5")
}


def quiet(what: str, done: int, total: int) -> None:
    """Nobody watches."""


def configured(**changes: object) -> tuple[FitSettings, Arm]:
    settings = load_settings("article-mech", {"simulation.other_joints": "locked"} | changes)
    return settings, settings.arm


@pytest.fixture(scope="module")
def problem(study_log: Log) -> Problem:
    """Noise-free data at the truth."""
    settings, arm = configured()
    return Problem(settings, [simulate_log(settings, study_log, TRUTH, "truth")])


@pytest.fixture(scope="module")
def designed() -> tuple[FitSettings, Arm, Design]:
    settings = load_settings("article-mech", TWO | {"design": DESIGN})
    return settings, settings.arm, design(settings, THETA, [], 3, quiet)


def test_a_slope_is_what_simulate_shows_for_one_percent(problem: Problem, study_log: Log):
    settings, arm = configured()
    found = sweep(problem, THETA, quiet)
    for name in ("K", "D", "M3"):
        up, down = (
            simulate_log(settings, study_log, TRUTH | {name: f * TRUTH[name]}, "t").angle[:, 1]
            for f in (1.005, 0.995)
        )
        slope = found.slopes[0][list(TRUTH).index(name)]
        assert slope == pytest.approx(up - down, abs=1e-3 * np.abs(slope).max())


def test_a_parameter_without_effect_moves_nothing_anywhere_within_its_bounds(problem: Problem):
    found = sweep(problem, THETA, quiet)
    idle = list(TRUTH).index("M1")
    assert np.abs(found.slopes[0][idle]).max() < 1e-9 * np.abs(found.slopes[0]).max()
    assert np.ptp(found.responses[0][idle], axis=0).max() < 1e-9
    assert found.responses[0].shape == (9, SWEEP_POINTS, len(problem.logs[0].time))


def test_only_free_parameters_are_swept(study_log: Log):
    settings, arm = configured(**{"parameters.K.fixed": 0.2})
    found = sweep(Problem(settings, [study_log]), THETA, quiet)
    assert "K" not in [list(TRUTH)[i] for i in found.free]
    assert len(found.slopes[0]) == 8


def test_sensitivity_is_written_in_the_readers_units(study_log: Log, tmp_path: Path):
    settings, arm = configured(**{f"parameters.{name}.fixed": TRUTH[name] for name in list(TRUTH)[2:]})
    log = simulate_log(settings, study_log, TRUTH, "truth")
    problem = Problem(settings, [log])
    found = sweep(problem, THETA, quiet)
    page = sensitivity_page(problem, THETA, found)
    write_page(page, tmp_path)
    table = page.tables["sensitivity"]
    data = np.genfromtxt(tmp_path / "sensitivity_steps_q2.csv", delimiter=",", names=True)
    assert data["K_deg_per_pct"] == pytest.approx(np.degrees(found.slopes[0][0]))
    assert data["q2_deg"] == pytest.approx(np.degrees(problem.channels[0].measured))
    rms = {row["parameter"]: row["rms per 1 %"] for row in table.records()}
    assert rms["K"] == pytest.approx(np.sqrt(np.mean(data["K_deg_per_pct"] ** 2)))
    assert (tmp_path / "figures" / "bounds_steps_q2.png").stat().st_size > 10_000


def test_the_surface_of_noise_free_data_is_lowest_at_the_truth(problem: Problem):
    found = surface(problem, THETA, ("K", "D"), 5, 0.2, quiet)
    assert found.lowest == pytest.approx((0.2, 231.8, 0.0), abs=1e-9)
    assert found.estimate_error == pytest.approx(0.0, abs=1e-9)
    # each point is the objective there, whatever the batch it stood in
    theta = THETA.copy()
    theta[0], theta[1] = found.values[0][0], found.values[1][3]
    assert found.error[0, 3] == problem.evaluate(theta[None]).overall[0]


def test_the_surface_of_a_null_direction_is_a_valley(problem: Problem):
    found = surface(problem, THETA, ("M1", "K"), 5, None, quiet)
    assert np.ptp(found.error, axis=0).max() < 1e-9
    assert np.ptp(found.error, axis=1).min() > 1e-3


def test_infeasible_points_are_neither_lowest_nor_drawn_as_errors(problem: Problem):
    found = surface(problem, THETA, ("K", "D"), 5, None, quiet)
    error = found.error.copy()
    error[0, 0] = np.inf
    holed = replace(found, error=error)
    assert holed.infeasible == 1
    assert np.isfinite(holed.lowest[2])
    texts = [t.get_text() for t in contours(holed, problem.settings.objective).legends[0].get_texts()]
    assert "infeasible (1 points)" in texts


@pytest.mark.parametrize(
    ("names", "around", "says"),
    [
        (("K", "X"), None, "no parameter 'X'"),
        (("K", "K"), None, "stands there twice"),
        (("K", "M2"), None, "M2 has no range"),
    ],
)
def test_a_surface_that_cannot_be_is_refused(study_log: Log, names, around, says):
    settings, arm = configured(**{"parameters.M2": {"quantity": "mass", "link": "link2", "fixed": 5.1}})
    with pytest.raises(SettingsError, match=says):
        surface(Problem(settings, [study_log]), THETA, names, 3, around, quiet)


def test_a_design_keeps_its_limits_when_simulate_runs_it(designed):
    settings, arm, found = designed
    run = simulate_log(settings, found.log, TRUTH, "truth")
    assert np.abs(run.angle - found.best.angle).max() < 1e-9
    assert violation(run.angle, found.period, arm, settings.design) is None
    assert np.abs(found.log.command).max() <= settings.design.command_pct
    assert found.log.duration == pytest.approx(6.0)
    for joint, signal in found.best.experiment.inputs.items():
        assert joint in (1, 2)
        assert np.diff(signal.start).min(initial=50) >= 50  # the shortest dwell, 0.5 s


@pytest.mark.parametrize(
    "tight", [{"speed_deg_s": 3}, {"margin_deg": 25, "poses": ["study"]}, {"command_pct": 20}]
)
def test_tight_limits_are_kept_too(tight):
    settings = load_settings(
        "article-mech", TWO | {"design": DESIGN | {"candidates": 2, "improvements": 1} | tight}
    )
    found = design(settings, THETA, [], 1, quiet)
    run = simulate_log(settings, found.log, TRUTH, "truth")
    speed = np.degrees(np.abs(np.diff(run.angle, axis=0))).max() / 0.01
    assert speed <= settings.design.speed_deg_s
    assert violation(run.angle, 0.01, settings.arm, settings.design) is None
    assert np.abs(run.command).max() <= settings.design.command_pct


def test_a_violation_is_found_where_it_is(arm: Arm):
    limits = DesignSettings(margin_deg=5, speed_deg_s=10)
    angle = np.tile(arm.pose("study"), (100, 1))
    assert violation(angle, 0.01, arm, limits) is None
    angle[60:, 1] += np.radians(0.11)  # 11 deg/s for one sample
    found = violation(angle, 0.01, arm, limits)
    assert found is not None
    assert (found.sample, found.joint, found.fast) == (60, 1, True)


def test_the_same_seed_designs_the_same_experiment(designed):
    settings, arm, found = designed
    again = design(settings, THETA, [], 3, quiet)
    assert np.array_equal(again.log.command, found.log.command)
    assert np.array_equal(again.best.information, found.best.information)


def test_the_designed_experiment_is_no_worse_than_any_random_one(designed):
    _, _, found = designed
    weakest = found.judge.weakest(found.best.information)[0]
    assert all(weakest <= found.judge.weakest(t.information)[0] for t in found.random)
    assert weakest < found.random_weakest


def test_information_is_that_of_a_fit_to_the_same_log(designed):
    """The search's one-sided differences against the checked central ones."""
    settings, arm, found = designed
    log = simulate_log(settings, found.log, TRUTH, "truth")
    how = settings.objective.model_copy(update={"noise_deg": settings.design.noise_deg})
    problem = Problem(settings.model_copy(update={"objective": how}), [log])
    expected = log_information(problem, THETA)
    told = found.best.information
    scale = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    assert np.abs(told - expected).max() < 5e-3 * scale.max()
    ratio = found.judge.deviations(told) / found.judge.deviations(expected)
    assert ratio == pytest.approx(np.ones(len(ratio)), rel=0.02)


def test_more_time_never_tells_less(designed):
    settings, arm, found = designed
    seen = np.zeros((6, 6))
    for samples in (200, 400, 601):
        told = Bench(settings, THETA, found.period, samples).information(shortened(found, samples))
        assert told is not None
        assert np.linalg.eigvalsh(told - seen).min() > -1e-6 * np.trace(told)
        seen = told


def shortened(found: Design, samples: int):
    inputs = {}
    for joint, signal in found.best.experiment.inputs.items():
        kept = signal.start < samples
        inputs[joint] = replace(signal, start=signal.start[kept], level=signal.level[kept])
    return replace(found.best.experiment, inputs=inputs)


def test_information_adds_over_logs_and_only_helps(designed):
    settings, arm, found = designed
    log = simulate_log(settings, found.log, TRUTH, "truth")
    one, two = (log_information(Problem(settings, logs), THETA) for logs in ([log], [log, log]))
    assert two == pytest.approx(2 * one, rel=1e-6, abs=1e-6 * np.trace(one))
    alone, after = found.judge.deviations(), replace(found.judge, known=found.judge.known + one).deviations()
    assert np.all(after <= alone)
    few = settings.design.model_copy(update={"candidates": 2, "improvements": 0})
    known = design(settings.model_copy(update={"design": few}), THETA, [log], 4, quiet)
    assert not np.array_equal(known.log.command, found.log.command)  # another seed
    assert np.all(known.judge.deviations() < found.judge.deviations())


def test_correlated_noise_of_a_short_memory_is_white_noise():
    rng = np.random.default_rng(0)
    rows = rng.normal(size=(3, 500))
    white = sensor_noise(DesignSettings(noise_deg=0.1), 500, 0.01).whitened(rows)
    short = sensor_noise(DesignSettings(noise_deg=0.1, noise_correlation_s=1e-4), 500, 0.01)
    assert short.whitened(rows) == pytest.approx(white, rel=1e-6)
    # the closed form of a first-order autoregression
    phi = np.exp(-0.1)
    memory = sensor_noise(DesignSettings(noise_deg=0.1, noise_correlation_s=0.1), 500, 0.01)
    expected = (rows[:, 1:] - phi * rows[:, :-1]) / np.sqrt(1 - phi**2) / np.radians(0.1)
    assert memory.whitened(rows)[:, 1:] == pytest.approx(expected)


def test_null_directions_neither_hide_the_others_nor_look_known():
    told = np.diag([100.0, 4.0, 0.0])
    judge = Judge.of(np.zeros((3, 3)), told)
    assert judge.directions.shape == (3, 2)
    assert judge.deviations(told) == pytest.approx([1 / np.sqrt(101), 1 / np.sqrt(5), 1.0])
    weakest, direction = judge.weakest(told)
    assert weakest == pytest.approx(1 / np.sqrt(5))
    assert np.abs(direction) == pytest.approx([0, 1, 0], abs=1e-12)
    better = np.diag([100.0, 9.0, 0.0])
    for criterion in ("D", "E"):
        assert judge.score(better, criterion) > judge.score(told, criterion)


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"joints": [9]}, "joints 1 to 7"),
        ({"poses": ["asleep"]}, "no pose 'asleep'"),
        ({"poses": ["home"]}, "no pose of home is 5 deg inside"),
        ({"margin_deg": 70}, "none of 4 random experiments keeps the limits"),
    ],
)
def test_a_design_that_cannot_be_is_refused(changes, says):
    settings = load_settings("article-mech", TWO | {"design": DESIGN | changes})
    with pytest.raises(SettingsError, match=says):
        design(settings, THETA, [], 1, quiet)


def test_the_table_flags_what_is_not_determined(designed):
    settings, _, found = designed
    rows = design_table(settings.design, found, TRUTH).records()
    assert [row["name"] for row in rows] == list(found.names)
    for row in rows:
        assert (row["flag"] != "") == (row["designed [%]"] > 30)
