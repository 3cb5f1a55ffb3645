from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from conftest import step_log

from hydroid import load_settings, read_logs
from hydroid.errors import HydroidError, RunError, SettingsError
from hydroid.fitting.fit import fit
from hydroid.fitting.memo import Memo
from hydroid.fitting.validation import error_indices
from hydroid.log import write_log
from hydroid.parameters import relative_error
from hydroid.prediction import simulate_log
from hydroid.problem.problem import Problem
from hydroid.problem.stage import Stage
from hydroid.run.folder import RunFolder

TRUTH = {"K": 0.2, "D": 231.8, "S": 53.4, "M1": 4.6, "M2": 5.1, "M3": 22.5, "M4": 1.6, "M5": 4.0, "M6": 4.7}
SMALL = {
    "search.ga.population": 10,
    "search.ga.generations": 6,
    "search.nsga2.population": 8,
    "search.nsga2.generations": 6,
    "objective.segments": {"equal": 3},
}


class Watcher:
    def __init__(self, stop_at: int | None = None) -> None:
        self.rows, self.stop_at = [], stop_at

    def generation(self, row) -> None:
        self.rows.append(row)
        if len(self.rows) == self.stop_at:
            raise KeyboardInterrupt

    def refining(self, simulated: int) -> None:
        pass


def make(tmp_path: Path, **changes):
    settings = load_settings("article-mech", SMALL | changes)
    log = step_log(settings.arm.pose("study"), [60.0, -80.0, 30.0, 0.0, -40.0])
    log = simulate_log(settings, log, TRUTH, "truth")
    path = tmp_path / "log.csv"
    write_log(path, log, settings.log)
    return settings, settings.arm, log, path


def run(folder: RunFolder, settings, arm, log, path, watcher):
    problem = Problem(settings, [log])
    checkpoint = None
    if folder.exists:
        folder.check(settings, read_logs([path], settings))
        checkpoint = folder.checkpoint()
    else:
        folder.begin(settings, read_logs([path], settings))
    result = fit(problem, folder.save, watcher, checkpoint)
    folder.write_estimate(problem, result)
    return result


def test_truth_has_no_error_and_evaluation_does_not_depend_on_the_chunk(tmp_path):
    settings, arm, log, _ = make(tmp_path)
    problem = Problem(settings, [log])
    truth = problem.parameters.vector(TRUTH, "truth")
    theta = np.vstack([truth, problem.parameters.from_unit(np.random.default_rng(0).random((9, 9)))])
    evaluation = problem.evaluate(theta)
    assert evaluation.overall[0] == 0
    assert (evaluation.overall[1:] > 0).all()
    np.testing.assert_allclose(
        evaluation.segments.max(axis=1), evaluation.overall
    )  # p = inf: the worst segment
    chunked = load_settings("article-mech", SMALL | {"simulation.chunk_mib": 1})
    again = Problem(chunked, [log]).evaluate(theta)
    np.testing.assert_array_equal(again.segments, evaluation.segments)


def test_several_logs_and_outputs_are_one_long_error(tmp_path):
    settings, arm, log, _ = make(tmp_path, outputs=[2, 3])
    short = replace(log, time=log.time[:200], command=log.command[:200], angle=log.angle[:200])
    problem = Problem(settings, [log, short])
    truth = problem.parameters.vector(TRUTH, "truth")[None]
    residuals = problem.residuals(truth * 1.1)
    assert residuals.shape == (1, 2 * (500 + 200))
    assert problem.bounds.shape == (2 * 2 * 3, 2)
    assert (np.diff(problem.bounds, axis=1) > 0).all()
    alone = Problem(settings, [short]).residuals(truth * 1.1)
    np.testing.assert_array_equal(residuals[:, 1000:], alone)
    np.testing.assert_allclose(problem.residuals(truth), 0, atol=1e-12)


def test_identical_sets_are_simulated_once(tmp_path):
    settings, arm, log, _ = make(tmp_path)
    memo = Memo(Problem(settings, [log]))
    theta = np.repeat(memo.problem.parameters.from_unit(np.random.default_rng(0).random((2, 9))), 3, axis=0)
    result = memo.evaluate(theta)
    assert memo.simulated == 2
    np.testing.assert_array_equal(result.overall[:3], result.overall[0])
    again = Memo(memo.problem)
    again.restore(*memo.arrays())
    np.testing.assert_array_equal(again.evaluate(theta).segments, result.segments)
    assert again.simulated == 2


@pytest.mark.parametrize("algorithm", ["ga", "nsga2"])
def test_a_fit_recovers_what_the_data_tell_and_names_what_they_do_not(tmp_path, algorithm):
    settings, arm, log, _ = make(tmp_path, **{"search.algorithm": algorithm})
    problem = Problem(settings, [log])
    result = fit(problem, lambda state, memo: None, Watcher())
    names = np.array(problem.parameters.names)
    assert list(names[result.without_effect]) == ["M1"]
    truth = problem.parameters.vector(TRUTH, "truth")
    assert result.best.rms < np.deg2rad(1e-3)
    # five seconds do not determine all nine, but the ratios K : D : S are strong
    ratio = (result.best.theta / truth)[:3]
    np.testing.assert_allclose(ratio / ratio[0], 1, rtol=0.01)
    assert relative_error(result.searched.theta, truth).sum() > 0.1  # the search alone does not find them
    expected = {"best", "refined"} if algorithm == "ga" else {"average", "utopia", "best", "refined"}
    assert set(result.estimates) == expected


@pytest.mark.parametrize("algorithm", ["ga", "nsga2"])
@pytest.mark.parametrize("stop", [1, 3, 7])
def test_a_resumed_run_ends_as_the_uninterrupted_one(tmp_path, algorithm, stop):
    settings, arm, log, path = make(tmp_path, **{"search.algorithm": algorithm})
    whole = run(RunFolder(tmp_path / "whole"), settings, arm, log, path, Watcher())
    folder = RunFolder(tmp_path / "parts")
    with pytest.raises(KeyboardInterrupt):
        run(folder, settings, arm, log, path, Watcher(stop_at=stop))
    rest = Watcher()
    parts = run(folder, settings, arm, log, path, rest)
    assert len(rest.rows) == 7 - stop
    np.testing.assert_array_equal(parts.history, whole.history)
    for name, estimate in whole.estimates.items():
        np.testing.assert_array_equal(parts.estimates[name].theta, estimate.theta)
    assert (tmp_path / "whole/estimate.yaml").read_bytes() == (folder.path / "estimate.yaml").read_bytes()


def test_the_seed_decides_every_bit(tmp_path):
    settings, arm, log, _ = make(tmp_path, refinement=None)
    problem = Problem(settings, [log])
    runs = [fit(problem, lambda state, memo: None, Watcher()) for _ in range(2)]
    np.testing.assert_array_equal(runs[0].history, runs[1].history)
    other = settings.model_copy(update={"search": settings.search.model_copy(update={"seed": 2})})
    differs = fit(Problem(other, [log]), lambda state, memo: None, Watcher())
    assert not np.array_equal(differs.history, runs[0].history)


def test_a_folder_of_another_run_is_refused_by_name(tmp_path):
    settings, arm, log, path = make(tmp_path, refinement=None)
    folder = RunFolder(tmp_path / "run")
    run(folder, settings, arm, log, path, Watcher())
    assert folder.settings().parameters == settings.parameters
    changed = settings.model_copy(update={"outputs": (3,)})
    with pytest.raises(RunError, match="outputs"):
        folder.check(changed, read_logs([path], settings))
    threads = settings.simulation.model_copy(update={"threads": 1})
    folder.check(
        settings.model_copy(update={"simulation": threads}), read_logs([path], settings)
    )  # changes no result
    path.write_text(path.read_text() + "# edited\n")
    with pytest.raises(RunError, match="log"):
        folder.check(settings, read_logs([path], settings))
    with pytest.raises(RunError, match="holds no run"):
        RunFolder(tmp_path).begin(settings, read_logs([path], settings))
    with pytest.raises(RunError, match="no run"):
        RunFolder(tmp_path / "nowhere").settings()


@pytest.mark.parametrize("keep", [0, 10, 0.5, -1])
def test_a_damaged_checkpoint_is_an_error_not_a_traceback(tmp_path, keep):
    settings, arm, log, path = make(tmp_path, refinement=None)
    folder = RunFolder(tmp_path / "run")
    run(folder, settings, arm, log, path, Watcher())
    file = folder.path / "checkpoint.npz"
    data = file.read_bytes()
    file.write_bytes(data[: int(len(data) * keep) if isinstance(keep, float) else keep])
    with pytest.raises(RunError, match=r"checkpoint\.npz"):
        folder.checkpoint()


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"parameters.M1.link": "link9"}, "link9"),
        ({"parameters.K.joints": [8]}, "joints 1 to 7"),
        (
            {"parameters.X": {"quantity": "gain", "joints": [2], "bounds": [0, 1]}},
            "K and X both set the gain",
        ),
    ],
)
def test_parameters_that_do_not_fit_the_arm_are_refused(change, says):
    settings = load_settings("article-mech", change)
    with pytest.raises(SettingsError, match=says):
        Stage(settings)


def test_all_parameters_fixed_is_refused():
    changes = {f"parameters.{name}.fixed": value for name, value in TRUTH.items()}
    settings = load_settings("article-mech", changes)
    with pytest.raises(HydroidError, match="free"):
        Problem(settings, [step_log(settings.arm.pose("study"), [60.0])])


def test_a_fixed_parameter_stays_and_the_others_move(tmp_path):
    settings, arm, log, _ = make(tmp_path, **{"parameters.M3.fixed": 22.5})
    problem = Problem(settings, [log])
    result = fit(problem, lambda state, memo: None, Watcher())
    assert all(estimate.theta[5] == 22.5 for estimate in result.estimates.values())
    assert result.best.rms < result.searched.rms


def test_shared_and_own_parameters_of_joints():
    own = {
        "parameters.K.joints": [2],
        "parameters.K3": {"quantity": "gain", "joints": [3], "bounds": [0.1, 1.0]},
    }
    settings = load_settings("article-mech", own)
    stage = Stage(settings)
    values = stage.candidates(stage.parameters.vector(TRUTH | {"K3": 0.7}, "here")[None])
    np.testing.assert_array_equal(values.gain[0], [0, 0.2, 0.7, 0, 0, 0, 0])
    assert values.mass[0].sum() == pytest.approx(45.0)


def test_error_indices_against_their_definitions():
    rng = np.random.default_rng(0)
    measured, error = rng.normal(size=500), 0.1 * rng.normal(size=500)
    indices = error_indices(measured, measured - error)
    assert indices.largest == pytest.approx(np.abs(error).max())
    assert indices.mean_absolute <= indices.rms <= indices.largest
    assert error_indices(measured, measured).fit == 100
    assert error_indices(measured, np.full(500, measured.mean())).fit == pytest.approx(0, abs=1e-9)
    assert np.isnan(error_indices(np.ones(5), np.zeros(5)).fit)


def test_a_joint_that_nothing_drives_is_refused(tmp_path):
    _, arm, log, _ = make(tmp_path)
    elsewhere = load_settings("article-mech", SMALL | {"parameters.K.joints": [3]})
    with pytest.raises(SettingsError, match=r"joint 2 .* gain"):
        Problem(elsewhere, [log])
