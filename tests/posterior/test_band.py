"""The prediction band: it holds its share of a log where the model is right, and says
where it is wrong."""

from dataclasses import replace

import numpy as np
import pytest
from made_errors import drawn
from made_logs import FAST, fast_arm, noisy, stepped
from recovery import bands_in, model_of, refined

import hydroid
from hydroid.log import Log
from hydroid.posterior.band import error_variances
from hydroid.posterior.error_filter import SHORTEST
from hydroid.posterior.error_model import make_error_model
from hydroid.problem.problem import Problem
from hydroid.settings.search import RefinementSettings

DRIFT = np.array([np.radians(0.1) ** 2, 0.0, 2e-4, 0.0, SHORTEST])
"""an error of 0.1 deg, and a drift that grows with the way"""


def driven(settings, levels, seed: int, values=FAST) -> Log:
    """A log of steps of the shoulder with white noise of 0.1 deg, but for its first
    sample."""
    return noisy(
        replace(stepped(settings, values, levels), source=f"steps{seed}.csv"), 0.1, seed
    )


def drifting(settings, log: Log, seed: int) -> Log:
    """The same log with a drift added."""
    (course,) = make_error_model(Problem(settings, [log])).courses
    rng, angle = np.random.default_rng(100 + seed), log.angle.copy()
    angle[:, 1] += drawn(rng, course, DRIFT * [0.0, 1.0, 1.0, 1.0, 1.0])[0]
    return replace(log, angle=angle)


@pytest.fixture(scope="module")
def fitted():
    quick = {"search.algorithm": "ga", "search.ga.generations": 4}
    settings = fast_arm([2], "K", "D", "S", **quick)
    return settings, hydroid.fit(
        settings, [driven(settings, [60.0, -80.0, 30.0, 0.0, -40.0], 1)]
    ).model


@pytest.mark.parametrize(("factor", "limits"), [(1.0, False), (1.5, True)])
def test_a_band_holds_what_the_model_explains(fitted, factor, limits):
    settings, model = fitted
    log = driven(
        settings, [-30.0, 50.0, 20.0, -70.0], 2, FAST | {"S": factor * FAST["S"]}
    )
    band = bands_in(model, log)[2]
    assert np.degrees(band.noise) == pytest.approx(0.1, rel=0.15)
    assert (band.inside > 0.9, band.inside < 0.8) == (not limits, limits)
    if not limits:
        assert band.error < 1.3 * band.expected


def test_a_band_carries_the_drift_and_holds_its_share_of_unseen_samples():
    """Of thirty unseen logs whose errors are drifts by the way: 95 %, of which few logs
    are independent."""
    settings = fast_arm([2], "K", "D", "S")
    levels = [60.0, -80.0, 30.0, 0.0, -40.0, 70.0]
    logs = [
        drifting(settings, driven(settings, levels[i:] + levels[:i], i), i)
        for i in range(4)
    ]
    problem = Problem(settings, logs)
    theta = refined(
        problem, problem.parameters.vector(FAST, "truth"), RefinementSettings()
    )
    model = model_of(problem, theta)
    unseen = [
        drifting(settings, driven(settings, levels[::-1], 10 + i), 10 + i)
        for i in range(30)
    ]
    bands = [bands_in(model, log)[2] for log in unseen]
    assert 0.9 < np.mean([band.inside for band in bands]) <= 1.0
    ratio = np.sqrt(
        np.mean([band.error**2 for band in bands])
        / np.mean([b.expected**2 for b in bands])
    )
    assert 0.6 < ratio < 1.2
    # wider the further the joint has travelled
    assert (bands[0].half[-1] > 1.1 * bands[0].half[0]).all()


def test_what_logs_left_out_show_widens_a_band_within_seconds_and_not_at_once(fitted):
    settings, model = fitted
    log = driven(settings, [-30.0, 50.0, 20.0, -70.0], 2)
    assert model.summary is not None
    wrong = {"left_out_deg": {"q2": (2.0, 3.0, 2.5)}}
    doubted = replace(model, summary=model.summary.model_copy(update=wrong))
    narrow = bands_in(model, log)[2]
    wide = bands_in(doubted, log)[2]
    assert np.degrees(wide.expected) == pytest.approx(np.sqrt(np.mean([4, 9, 6.25])))
    # where the start is known nothing can have gone wrong yet
    assert wide.half[0] == narrow.half[0]
    assert wide.half[-1] > 5 * narrow.half[-1]


def test_the_variance_of_an_error_is_along_the_simulated_way(fitted):
    settings, _ = fitted
    log = driven(settings, [60.0, -80.0], 1)
    errors = replace(make_error_model(Problem(settings, [log])), numbers=DRIFT[None])
    still = np.full(len(log.time), 0.3)
    sensor, drift = error_variances(errors, 0, still)
    assert sensor == DRIFT[0]
    start = DRIFT[0] / errors.courses[0].readings
    np.testing.assert_allclose(drift, start, rtol=1e-9)
    moving = still + 0.1 * log.time
    _, drift = error_variances(errors, 0, moving)
    assert drift[-1] - start == pytest.approx(DRIFT[2] * 0.1 * log.duration, rel=0.05)


def test_leaving_out_each_log_predicts_it(fitted):
    settings, model = fitted
    drives = [60, -80, 30], [-30, 50, 20], [40, -60, 50]
    logs = [driven(settings, levels, seed) for seed, levels in enumerate(drives)]
    for i, log in enumerate(logs):
        problem = Problem(settings, [*logs[:i], *logs[i + 1 :]])
        fold = model_of(problem, refined(problem, model.theta, RefinementSettings()))
        band = bands_in(fold, log)[2]
        assert 0.5 < band.error / band.expected < 1.2
