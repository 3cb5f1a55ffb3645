"""Priors hold in the search, and count as measurements in the refinement."""

import numpy as np
import pytest
from made_logs import TRUTH, noisy, stepped
from recovery import refined
from scipy.stats import multivariate_t, t

from hydroid import load_settings
from hydroid.errors import SettingsError
from hydroid.parameters import Parameter, ParameterSet
from hydroid.problem.priors import REACH, Priors
from hydroid.problem.problem import Problem
from hydroid.settings.problem import PriorSettings
from hydroid.settings.search import RefinementSettings

PARAMETERS = ParameterSet(
    (
        Parameter("a", "kg", 1.0, 10.0),
        Parameter("b", "kg", 1.0, 10.0),
        Parameter("c", "kg", 0.0, 4.0, fixed=2.0),
        Parameter("d", "N", 100.0, 1000.0),
    )
)


def priors(**settings) -> Priors:
    return Priors(
        {n: PriorSettings.model_validate(s) for n, s in settings.items()}, PARAMETERS
    )


def random_candidates(n: int) -> np.ndarray:
    return PARAMETERS.from_unit(np.random.default_rng(0).random((n, 3)))


def test_scores_are_distances_in_standard_deviations():
    known = priors(
        sum={"of": ["a", "b", "c"], "value": 10.0, "sd": 0.5},
        part={"of": {"a": 1.0, "d": -0.01}, "value": 0.0, "sd": 0.1},
        ratio={"ratio": ["a", "b"], "value": 2.0, "sd": 0.25},
        prior={"of": "d", "value": 400.0, "sd": 50.0},
    )
    scores = known.scores(np.array([[6.0, 2.0, 2.0, 500.0]]))
    assert scores == pytest.approx(np.array([[0.0, 10.0, 4.0, 2.0]]))


def test_heavy_tails_are_students_distribution():
    known = priors(
        tie={"of": {"a": 1.0, "b": -1.0}, "value": 0.0, "sd": 0.5, "tails": "heavy"}
    )
    apart = np.array([0.0, 0.1, 0.5, 4.0])
    theta = np.array([[5.0 + one, 5.0, 2.0, 500.0] for one in apart])
    logs = t.logpdf(apart / 0.5, df=2)
    assert 0.5 * known.scores(theta)[:, 0] ** 2 == pytest.approx(
        logs[0] - logs, abs=1e-9
    )


def test_the_bends_of_a_curve_share_one_scatter():
    known = priors(curve={"smooth": ["a", "b", "d"], "sd": 0.3})
    theta = np.array([[2.0, 4.0, 2.0, 100.0], [1.0, 1.0, 2.0, 1.0]])
    bends = np.log([2.0 / 4.0, 4.0 / 100.0, 100.0]) / 0.3
    density = multivariate_t(shape=np.eye(3), df=2)
    expected = density.logpdf(np.zeros(3)) - density.logpdf(bends)
    squares = (known.scores(theta) ** 2).sum(axis=1)
    assert 0.5 * squares == pytest.approx([expected, 0.0])


def test_weighed_scores_have_the_slopes_of_the_density():
    tie = {"of": {"a": 1.0, "b": -1.0}, "value": 0.0, "sd": 0.5, "tails": "heavy"}
    known = priors(
        tie=tie,
        curve={"smooth": ["a", "b", "d"], "sd": 0.3},
        d={"of": "d", "value": 400, "sd": 50},
    )
    theta, step = np.array([4.0, 2.0, 2.0, 300.0]), 1e-5
    weighed = known.weighed_at(theta)
    for column in (0, 1, 3):
        near = np.tile(theta, (2, 1))
        near[:, column] += (-step, step)
        slope = np.diff(0.5 * (known.scores(near) ** 2).sum(axis=1))
        assert weighed(theta[None])[0] @ np.diff(weighed(near), axis=0)[
            0
        ] == pytest.approx(slope[0], rel=1e-4)


def test_heavy_tails_confine_no_search():
    known = priors(
        tie={"of": {"a": 1.0, "b": -1.0}, "value": 0.0, "sd": 0.1, "tails": "heavy"},
        curve={"smooth": ["a", "b"], "sd": 0.1},
    )
    candidates = random_candidates(20)
    assert np.array_equal(known.project(candidates), candidates)
    assert not known.firm.any()


def test_a_search_stays_where_every_prior_nearly_holds():
    known = priors(
        sum={"of": ["a", "b", "c"], "value": 10.0, "sd": 0.5},
        ratio={"ratio": ["a", "b"], "value": 2.0, "sd": 0.01},
        prior={"of": "d", "value": 400.0, "sd": 50.0},
    )
    moved = known.project(random_candidates(200))
    assert np.all(np.abs(known.scores(moved)) <= REACH * 1.001)
    assert np.all(moved[:, PARAMETERS.free] >= PARAMETERS.lower[PARAMETERS.free])
    assert np.all(moved[:, PARAMETERS.free] <= PARAMETERS.upper[PARAMETERS.free])
    assert np.all(moved[:, 2] == 2.0)


def test_projection_is_idempotent_and_row_by_row():
    known = priors(
        sum={"of": ["a", "b"], "value": 8.0, "sd": 0.1},
        d={"of": "d", "value": 300, "sd": 1},
    )
    candidates = random_candidates(50)
    moved = known.project(candidates)
    assert known.project(moved) == pytest.approx(moved, rel=1e-12)
    assert np.array_equal(known.project(candidates[7:8]), moved[7:8])
    inside = np.array([[4.0, 4.0, 2.0, 300.0]])
    assert np.array_equal(known.project(inside), inside)


def test_priors_that_cannot_hold_are_refused():
    with pytest.raises(SettingsError, match="no parameter 'x'"):
        priors(wrong={"of": ["a", "x"], "value": 1.0})
    with pytest.raises(SettingsError, match="cannot hold within the bounds"):
        priors(wrong={"of": ["a", "b"], "value": 50.0, "sd": 0.5})
    with pytest.raises(SettingsError, match="no parameter 'x'"):
        priors(wrong={"smooth": ["a", "x"], "sd": 1.0})
    # about a fixed parameter only
    assert len(priors(c={"of": "c", "value": 1.0, "sd": 0.1})) == 0
    assert len(priors(ratio={"ratio": ["a", "c"], "value": 1.0, "sd": 0.1})) == 1


@pytest.mark.parametrize(
    "prior",
    [
        {"value": 1.0},
        {"of": "a", "ratio": ["a", "b"], "value": 1.0},
        {"of": [], "value": 1.0},
        {"of": {"a": 0.0}, "value": 1.0},
        {"of": "a", "value": 1.0, "sd": 0.0},
        {"of": "a", "value": 1.0, "tails": "heavy"},
        {"of": "a", "sd": 1.0},
        {"smooth": ["a", "b"]},
        {"smooth": ["a", "b"], "value": 1.0, "sd": 0.3},
        {"smooth": [], "sd": 0.3},
        {"smooth": ["a", "b"], "of": "a", "sd": 0.3},
    ],
)
def test_an_incomplete_prior_is_refused(prior):
    with pytest.raises(ValueError, match="validation error"):
        PriorSettings.model_validate(prior)


def test_a_refinement_weighs_priors_against_the_logs():
    """K, D, S and the masses but for the jaws have a common scale, which only the prior
    decides."""
    known = {
        "total": {"of": ["M1", "M2", "M3", "M4", "M5", "M6"], "value": 30.0, "sd": 0.3}
    }
    settings = load_settings("article-mech", {"priors": known, "objective.segments": 2})
    problem = Problem(
        settings, [noisy(stepped(settings, TRUTH, [60.0, -80.0, 30.0, 0.0]), 0.1)]
    )
    truth = problem.parameters.vector(TRUTH, "truth")
    theta = refined(problem, 0.9 * truth, RefinementSettings(iterations=30))[None]
    assert theta[0, 3:].sum() == pytest.approx(30.0, abs=0.3)
    assert np.rad2deg(problem.rms(problem.output_errors(theta))[0]) < 0.105
