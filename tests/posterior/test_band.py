"""The prediction band: it holds its share of a log where the model is right, and says where it is wrong."""

from dataclasses import replace

import numpy as np
import pytest
from made_logs import FAST, fast_arm, noisy, stepped

import hydroid
from hydroid.fitting.refinement import refine
from hydroid.fitting.summary import account
from hydroid.identified_model import IdentifiedModel
from hydroid.log import Log
from hydroid.posterior.band import prediction_bands, start_effects
from hydroid.posterior.uncertainty import uncertainty
from hydroid.prediction import predict
from hydroid.problem.problem import Problem
from hydroid.settings.search import RefinementSettings


def driven(settings, levels, seed: int, values=FAST) -> Log:
    """A log of steps of the shoulder with white noise of 0.1 deg, but for its first sample."""
    return noisy(replace(stepped(settings, values, levels), source=f"steps{seed}.csv"), 0.1, seed)


@pytest.fixture(scope="module")
def fitted():
    quick = {"search.algorithm": "ga", "search.ga.generations": 4}
    settings = fast_arm([2], "K", "D", "S", **quick)
    return settings, hydroid.fit(settings, [driven(settings, [60.0, -80.0, 30.0, 0.0, -40.0], 1)]).model


@pytest.mark.parametrize(("factor", "limits"), [(1.0, False), (1.5, True)])
def test_a_band_holds_what_the_model_explains(fitted, factor, limits):
    settings, model = fitted
    log = driven(settings, [-30.0, 50.0, 20.0, -70.0], 2, FAST | {"S": factor * FAST["S"]})
    response = predict(model, log, settings.outputs)
    band = prediction_bands(model, log, response)[2]
    assert np.degrees(band.noise) == pytest.approx(0.1, rel=0.15)
    assert (band.inside > 0.9, band.inside < 0.8) == (not limits, limits)
    if not limits:
        # this log's start has no noise, which the fit cannot know
        start = start_effects(Problem(settings, [log]), model.theta, {2: band.noise})[2]
        assert band.error**2 == pytest.approx(band.expected**2 - np.sum(start**2) / len(log.time), rel=0.3)


def test_a_band_includes_what_the_noise_of_the_start_does(fitted):
    settings, model = fitted
    log, rng = driven(settings, [-30.0, 50.0], 2), np.random.default_rng(4)
    off = []
    for _ in range(60):
        angle = log.angle.copy()
        angle[0] += rng.normal(0, np.radians(0.1), angle.shape[1])
        off.append(predict(model, replace(log, angle=angle), settings.outputs)[:, 0])
    effects = start_effects(Problem(settings, [log]), model.theta, {2: np.radians(0.1)})[2]
    variance = np.sum(effects**2, axis=0)
    np.testing.assert_allclose(np.var(off, axis=0).mean(), variance.mean(), rtol=0.4)


def test_leaving_out_each_log_predicts_it(fitted):
    settings, model = fitted
    drives = [60, -80, 30], [-30, 50, 20], [40, -60, 50]
    logs = [driven(settings, levels, seed) for seed, levels in enumerate(drives)]
    for i, log in enumerate(logs):
        problem = Problem(settings, [*logs[:i], *logs[i + 1 :]])
        theta = problem.parameters.from_unit(
            refine(problem, model.theta, RefinementSettings(), lambda *_: None, {}, "fold").point
        )
        fold = IdentifiedModel(settings, theta, "fold", account(problem, uncertainty(problem, theta)))
        band = prediction_bands(fold, log, predict(fold, log, settings.outputs))[2]
        assert 0.5 < band.error / band.expected < 1.2
