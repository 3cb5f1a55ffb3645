import numpy as np
import pytest
from made_logs import TRUTH
from small_fits import Watcher, study

from hydroid import load_settings
from hydroid.errors import RunError, SettingsError
from hydroid.fitting.checkpoints import Memo
from hydroid.fitting.fit import fit
from hydroid.fitting.search import search
from hydroid.fitting.validation import error_indices
from hydroid.fitting.watcher import Silent
from hydroid.problem.problem import Problem


def test_truth_has_no_error_and_evaluation_does_not_depend_on_the_chunk(monkeypatch):
    problem = study()
    truth = problem.parameters.vector(TRUTH, "truth")
    theta = np.vstack(
        [truth, problem.parameters.from_unit(np.random.default_rng(0).random((9, 9)))]
    )
    values = problem.evaluate(theta)
    assert values[0, -1] == 0
    assert (values[1:, -1] > 0).all()
    # p = inf: the worst segment
    np.testing.assert_allclose(values[:, :-1].max(axis=1), values[:, -1])
    monkeypatch.setattr("hydroid.problem.problem.CHUNK", 3 * len(problem.measured))
    np.testing.assert_array_equal(problem.evaluate(theta), values)


def test_several_logs_and_outputs_are_one_long_error():
    one = study(outputs=[2, 3])
    (log,) = one.logs
    short = log.first(1.99)
    problem = Problem(one.settings, [log, short])
    truth = problem.parameters.vector(TRUTH, "truth")[None]
    errors = problem.output_errors(truth * 1.1)
    assert errors.shape == (1, 2 * (500 + 200))
    assert problem.bounds.shape == (2 * 2 * 3, 2)
    assert (np.diff(problem.bounds, axis=1) > 0).all()
    alone = Problem(one.settings, [short]).output_errors(truth * 1.1)
    np.testing.assert_array_equal(errors[:, 1000:], alone)
    np.testing.assert_allclose(problem.output_errors(truth), 0, atol=1e-12)


def test_identical_sets_are_simulated_once():
    memo = Memo(study())
    theta = np.repeat(
        memo.problem.parameters.from_unit(np.random.default_rng(0).random((2, 9))),
        3,
        axis=0,
    )
    result = memo.evaluate(theta)
    assert memo.simulated == 2
    np.testing.assert_array_equal(result[:3], result[[0, 0, 0]])
    again = Memo(memo.problem, memo.arrays())
    np.testing.assert_array_equal(again.evaluate(theta), result)
    assert again.simulated == 2


@pytest.mark.parametrize("algorithm", ["ga", "nsga2"])
def test_a_fit_recovers_what_the_data_tell_and_names_what_they_do_not(algorithm):
    problem = study(**{"search.algorithm": algorithm})
    result = fit(problem)
    names = np.array(problem.parameters.names)
    assert list(names[result.uncertainty.sensitivity == 0]) == ["M1"]
    truth = problem.parameters.vector(TRUTH, "truth")
    assert result.best.rms < np.deg2rad(1e-3)
    # five seconds do not determine all nine, but the ratios K : D : S are strong
    ratio = (result.best.theta / truth)[:3]
    np.testing.assert_allclose(ratio / ratio[0], 1, rtol=0.01)
    searched = next(iter(result.estimates.values()))
    # the search alone does not find them
    assert np.sum(np.abs(searched.theta / truth - 1)) > 0.1
    expected = (
        {"best", "refined"}
        if algorithm == "ga"
        else {"average", "utopia", "best", "refined"}
    )
    assert set(result.estimates) == expected
    assert set(result.seconds) == {"search", "refinement", "uncertainty"}
    assert min(result.seconds.values()) > 0


@pytest.mark.parametrize(("algorithm", "stop"), [("ga", 1), ("nsga2", 6)])
def test_a_resumed_search_ends_as_the_uninterrupted_one(algorithm, stop):
    """A search is repeated, and what it had simulated is not simulated again."""
    problem = study(**{"search.algorithm": algorithm})
    whole = search(problem, Silent(), {})
    stopped, rest, stored = Watcher(stop_at=stop), Watcher(), {}
    with pytest.raises(KeyboardInterrupt):
        search(problem, stopped, stored)
    parts = search(problem, rest, stored)
    assert len(rest.rows) == 7 - stop
    np.testing.assert_array_equal(parts.history, whole.history)
    np.testing.assert_array_equal(parts.theta, whole.theta)


def test_a_resumed_fit_ends_as_the_uninterrupted_one():
    problem, stored = study(refinement={"iterations": 2}), {}
    whole = fit(problem)
    with pytest.raises(KeyboardInterrupt):
        fit(problem, Watcher(stop_at=7), stored)
    parts = fit(problem, Watcher(), stored)
    assert (
        whole.estimates.keys()
        == parts.estimates.keys()
        == {"average", "utopia", "best", "refined"}
    )
    for name, one in whole.estimates.items():
        np.testing.assert_array_equal(parts.estimates[name].theta, one.theta)
    # the best of all that was simulated
    assert whole.estimates["best"].overall == whole.history[-1, 4]


def test_a_search_that_does_not_repeat_itself_is_found_out():
    problem, stored = study(refinement=None), {}
    with pytest.raises(KeyboardInterrupt):
        fit(problem, Watcher(stop_at=4), stored)
    # another version would ask for candidates that are not stored: here, because one is
    # lost
    stored["search"] = {
        n: np.delete(a, 20, axis=0) for n, a in stored["search"].items()
    }
    before = dict(stored)
    with pytest.raises(RunError, match="does not repeat"):
        fit(problem, checkpoints=stored)
    assert stored == before


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"parameters.M1.link": "link9"}, "link9"),
        ({"parameters.K.joints": [8]}, "joints 1 to 7"),
        ({"parameters.K.joints": [3]}, r"joint 2 .* gain"),
        (
            {"parameters.X": {"quantity": "gain", "joints": [2], "bounds": [0, 1]}},
            "K and X both set the gain",
        ),
        ({f"parameters.{name}.fixed": value for name, value in TRUTH.items()}, "free"),
    ],
)
def test_parameters_that_do_not_fit_the_arm_are_refused(change, says, study_log):
    with pytest.raises(SettingsError, match=says):
        Problem(load_settings("article-mech", change), [study_log])


def test_error_indices_against_their_definitions():
    rng = np.random.default_rng(0)
    measured, error = rng.normal(size=500), 0.1 * rng.normal(size=500)
    indices = error_indices(measured, error)
    assert indices.largest == pytest.approx(np.abs(error).max())
    assert indices.mean_absolute <= indices.rms <= indices.largest
    assert error_indices(measured, 0 * measured).fit == 100
    assert error_indices(measured, measured - measured.mean()).fit == pytest.approx(
        0, abs=1e-9
    )
    assert np.isnan(error_indices(np.ones(5), np.ones(5)).fit)
