"""The error model against textbooks: white innovations, dense covariances, and numbers
that are recovered."""

from dataclasses import replace

import numpy as np
import pytest
import statsmodels.api as sm
from made_errors import (
    DRIFTING,
    LASTING,
    SENSOR,
    course_of,
    covariance,
    drawn,
    drift_covariance,
    model_of_errors,
    stopping,
)
from made_logs import HYDRAULIC, TRUTH, noisy, simulate_log, stepped
from scipy.stats import multivariate_normal

from hydroid import load_settings
from hydroid.posterior.course import at_stops
from hydroid.posterior.error_filter import SHORTEST, whitened
from hydroid.posterior.error_model import (
    LEAST_NOISE,
    MEMORY,
    likelihood_at,
    make_error_model,
    make_likelihood,
)
from hydroid.problem.problem import Problem


def courses(samples: int) -> dict[str, object]:
    return {
        "plain": course_of(samples),
        "weighted": course_of(samples, weight=3.0),
        "stops": stopping(samples),
    }


EACH = [(name, numbers) for name in courses(1) for numbers in (DRIFTING, LASTING)]
each_course = pytest.mark.parametrize(("name", "numbers"), EACH)


@each_course
def test_innovations_are_white_with_variance_1(name, numbers):
    course, rng = courses(4000)[name], np.random.default_rng(1)
    white = model_of_errors([course], numbers).innovations(
        drawn(rng, course, numbers, 10)
    )
    white = white[:, course.used]
    count = white.size
    assert np.mean(white**2) == pytest.approx(1.0, abs=4 * np.sqrt(2 / count))
    assert np.mean(white) == pytest.approx(0.0, abs=4 / np.sqrt(count))
    for lag in (1, 2, 5, 20, 100):
        product = np.mean(white[:, lag:] * white[:, :-lag])
        assert product == pytest.approx(0.0, abs=4 / np.sqrt(count)), lag
    if name == "plain":  # errors themselves are far from it
        raw = drawn(rng, course, numbers, 1)[0] / np.sqrt(SENSOR)
        assert np.mean(raw**2) > 2.0


@each_course
def test_errors_and_innovations_give_each_other_and_are_linear(name, numbers):
    course, rng = courses(300)[name], np.random.default_rng(2)
    model, rows = model_of_errors([course], numbers), rng.normal(size=(2, 300))
    innovations = model.innovations(rows)
    np.testing.assert_allclose(
        model.errors(innovations)[:, course.used], rows[:, course.used], rtol=1e-9
    )
    assert not innovations[:, ~course.used].any()
    both = model.innovations((2.0 * rows[0] - 3.0 * rows[1])[None])[0]
    np.testing.assert_allclose(
        both, 2.0 * innovations[0] - 3.0 * innovations[1], atol=1e-9
    )


@each_course
def test_the_density_is_that_of_a_normal_vector_with_the_dense_covariance(
    name, numbers
):
    course = courses(60)[name]
    model, used = model_of_errors([course], numbers), course.used
    row = drawn(np.random.default_rng(3), course, numbers)[0]
    dense = covariance(course, numbers)[np.ix_(used, used)]
    expected = multivariate_normal(np.zeros(used.sum()), dense).logpdf(
        row[used] / course.weight
    )
    density = model.log_density(model.innovations(row[None])[0])
    assert density.sum() == pytest.approx(expected, rel=1e-9)
    assert not density[~used].any()
    # one after the other: the first half alone has the density of its own vector
    half = used[: len(used) // 2]
    dense = covariance(course, numbers)[: len(half), : len(half)][np.ix_(half, half)]
    first = multivariate_normal(np.zeros(half.sum()), dense).logpdf(
        row[: len(half)][half] / course.weight
    )
    assert density[: len(half)].sum() == pytest.approx(first, rel=1e-9)


@each_course
def test_a_scatter_is_that_of_the_dense_product(name, numbers):
    course, rng = courses(50)[name], np.random.default_rng(4)
    fitted = model_of_errors([course], np.array([2 * SENSOR, 1e-6, 0.0, 1e-6, 1.0]))
    # (T, T): of errors to innovations
    filtered = fitted.innovations(course.weight * np.eye(50)).T
    rows = rng.normal(size=(3, 50))
    expected = rows @ filtered @ covariance(course, numbers) @ filtered.T @ rows.T
    found = model_of_errors([course], numbers).scatter(0, rows, fitted)
    np.testing.assert_allclose(found, expected, rtol=1e-9)
    # where the errors are as the filter has them, innovations are white
    own = model_of_errors([course], numbers).scatter(
        0, rows, model_of_errors([course], numbers)
    )
    np.testing.assert_allclose(
        own, rows[:, course.used] @ rows[:, course.used].T, rtol=1e-9
    )


@each_course
def test_a_drifts_variance_is_that_of_simulated_drifts(name, numbers):
    course = courses(200)[name]
    found = model_of_errors([course], numbers).drift(course, 0)
    expected = np.diag(drift_covariance(course, numbers))
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-18)
    count = 20_000
    errors = drawn(np.random.default_rng(5), course, numbers, count)
    shown = np.var(errors / course.weight, axis=0) - numbers[0]
    total = found + numbers[0]
    assert np.all(np.abs(shown - found) < 5 * total * np.sqrt(2 / count))


@pytest.mark.parametrize("readings", [1.0, 10.0])
def test_a_drift_of_time_is_the_local_level_model_of_statsmodels(readings):
    numbers = np.array([SENSOR, 2e-5, 0.0, 0.0, SHORTEST])
    course = course_of(400, readings=readings)
    row = drawn(np.random.default_rng(6), course, numbers)[0]
    other = sm.tsa.UnobservedComponents(row, "local level", loglikelihood_burn=0)
    other.ssm.tolerance = 0.0  # its filter is not to stop where it is nearly steady
    other.ssm.initialize_known(np.zeros(1), np.array([[SENSOR / readings]]))
    expected = other.loglike([SENSOR, 2e-5 * course.period])
    model = model_of_errors([course], numbers)
    found = model.log_density(model.innovations(row[None])[0]).sum()
    assert found == pytest.approx(expected, rel=1e-9)
    steady = whitened(row[None], course.period, SENSOR, 2e-5)[0]
    start = model_of_errors([replace(course, readings=np.inf)], numbers)
    np.testing.assert_allclose(steady, start.innovations(row[None])[0], rtol=1e-9)


def test_the_numbers_are_recovered_from_long_records():
    """12 sets of five logs of 100 s: each number's mean is the truth, within four
    standard errors."""
    rng = np.random.default_rng(7)
    logs = [course_of(2000, 2000 * i, weight=3.0) for i in range(5)]
    found = []
    for _ in range(12):
        row = np.concatenate([drawn(rng, one, LASTING)[0] for one in logs])
        found.append(model_of_errors(logs, LASTING).estimated(row).numbers[0])
    for values, true in zip(np.transpose(found), LASTING, strict=True):
        error = np.std(values) / np.sqrt(len(values))
        assert abs(np.mean(values) - true) < 4 * error
        assert np.std(values) < true


def test_what_is_given_stays_and_nothing_else():
    course = course_of(2000)
    row = drawn(np.random.default_rng(8), course, LASTING)[0]
    stated = np.array([9 * SENSOR, 0.0, 0.0, 0.0, SHORTEST])
    told = replace(model_of_errors([course], stated), given=stated[:1])
    held = told.estimated(row).numbers[0]
    assert held[0] == pytest.approx(9 * SENSOR, rel=1e-12)
    assert model_of_errors([course], stated).estimated(row).numbers[
        0, 0
    ] == pytest.approx(SENSOR, rel=0.2)


@pytest.mark.parametrize(
    "before",
    [
        DRIFTING,
        [SENSOR, 1e-5, 1e-14, 1e-14, 0.05],
        [SENSOR, 1e-14, 1e-3, 1e-14, 0.05],
        [1e-3, 1e-14, 1e-14, 1e-2, 2.0],
        [SENSOR / 100, 1e-14, 1e-14, 1e-4, 0.05],
    ],
)
@pytest.mark.parametrize("lasting", [0.0, 2e-5])
def test_the_numbers_are_the_most_likely_from_whatever_numbers_before(before, lasting):
    """A number that was none before grows again where the errors ask for it."""
    rng, true = np.random.default_rng(9), np.array([SENSOR, 2e-6, 3e-5, lasting, 0.5])
    logs = [course_of(2000, 2000 * i) for i in range(3)]
    row = np.concatenate([drawn(rng, one, true)[0] for one in logs])

    def cost(model) -> float:
        return -model.log_density(model.innovations(row[None])[0]).sum()

    found = model_of_errors(logs, np.array(before)).estimated(row)
    assert cost(found) < cost(model_of_errors(logs, true))
    from_truth = model_of_errors(logs, true).estimated(row)
    assert cost(found) == pytest.approx(cost(from_truth), abs=0.5)


def test_white_noise_alone_is_weighed_by_its_mean_square_and_has_no_drift():
    rng = np.random.default_rng(10)
    course = replace(course_of(1000, weight=2.0), used=np.arange(1000) % 2 == 0)
    row = 2.0 * rng.normal(0.0, 0.01, 1000)
    shown = model_of_errors([course], DRIFTING).estimated(row)
    sensor, rate, way, lasting, _ = shown.numbers[0]
    # what lasts no longer than from sample to sample is as good as noise
    assert sensor + lasting == pytest.approx(1e-4, rel=0.15)
    assert rate * 50.0 + way * course.way.sum() < 0.1 * 1e-4  # after all of the log
    white = shown.weighing(np.inf, alike=False)
    assert not white.numbers[0, 1:4].any()
    # a drift that the log cannot exclude is what its errors may tell less than
    # independent ones
    square = np.mean((row[::2] / 2.0) ** 2)
    assert square <= white.numbers[0, 0] * (1 + 1e-9) < 10.0 * square
    quiet = model_of_errors([course], DRIFTING).estimated(1e-9 * row)
    level = quiet.weighing(np.inf, alike=False).numbers[0, 0]
    assert level == pytest.approx(LEAST_NOISE["angle"] ** 2, rel=0.01)


@pytest.mark.parametrize("memory", [1.0, MEMORY, 30.0])
def test_an_error_is_followed_within_the_memory_at_the_fastest(memory):
    """Of a step of the error the weighed errors show 1/e after the memory."""
    course = course_of(4000)
    # a drift that a filter of its own follows at once
    numbers = np.array([1e-8, 1e-3, 0.0, 0.0, SHORTEST])
    weighing = model_of_errors([course], numbers).weighing(memory, alike=False)
    step = np.where(np.arange(4000) >= 2000, 1.0, 0.0)
    left = weighing.innovations(step[None])[0, 2000:]
    assert left[round(memory / course.period)] / left[0] == pytest.approx(
        np.exp(-1.0), rel=0.05
    )


@pytest.mark.parametrize(
    "numbers", [DRIFTING, LASTING, [SENSOR, 1e-4, 0.0, 0.0, SHORTEST]]
)
def test_a_speed_is_as_certain_as_its_weighed_errors_say(numbers):
    """Least squares of one number, the joint's speed: its variance over many logs is 1
    over its squares."""
    course, rng = course_of(1000), np.random.default_rng(14)
    model = model_of_errors([course], np.array(numbers))
    rows = drawn(rng, course, np.array(numbers), 400)
    weighing = model.weighing(MEMORY, alike=False)
    motion = weighing.innovations(course.moved[None])[0]
    square = float(motion @ motion)
    left = weighing.innovations(rows)
    found = left @ motion / square
    assert np.var(found) * square == pytest.approx(1.0, rel=0.3)


def test_samples_left_out_are_as_if_they_had_not_been_measured():
    course, rng = course_of(200), np.random.default_rng(11)
    model, out = model_of_errors([course], DRIFTING), np.arange(200) >= 120
    row = drawn(rng, course, DRIFTING)[0]
    less = model.without(out)
    np.testing.assert_array_equal(less.used, ~out)
    changed = np.where(out, 100.0, row)
    np.testing.assert_array_equal(
        less.innovations(changed[None]), less.innovations(row[None])
    )
    assert not less.log_density(less.innovations(row[None])[0])[out].any()


def test_a_joint_is_at_its_stop_where_it_rests_there_and_not_where_it_turns_back():
    angle = np.full(200, 0.5)
    angle[50:100] = 1.0
    angle[150] = 1.0
    stops = at_stops(angle, (-1.0, 1.0), 0.05)
    assert stops[55:95].all()
    assert not stops[:50].any()
    assert not stops[100:].any()
    assert not at_stops(angle, (-np.inf, np.inf), 0.05).any()


def hydraulic(**changes) -> Problem:
    settings = load_settings("article-hyd", changes)
    truth = {name: HYDRAULIC[name] for name in settings.parameters if name in HYDRAULIC}
    return Problem(
        settings,
        [noisy(stepped(settings, truth, [0.0, 60.0, -40.0]), 0.1, exact_start=False)],
    )


def test_an_error_model_of_a_problem_has_the_start_of_the_log_and_the_noise_of_the_settings():
    free, held = (
        hydraulic(free_start=True),
        hydraulic(free_start=False, **{"objective.noise_deg": {2: 0.3}}),
    )
    (course,), (exact,) = (make_error_model(one).courses for one in (free, held))
    (log,) = free.logs
    assert course.readings == pytest.approx(max(log.start_samples[1], 1.0))
    assert exact.readings == np.inf
    model = make_error_model(held)
    assert np.degrees(np.sqrt(model.given)) == pytest.approx(0.3)
    assert np.degrees(np.sqrt(model.numbers[0, 0])) == pytest.approx(0.3)
    assert np.isnan(make_error_model(free).given).all()
    rows = np.random.default_rng(12).normal(size=len(log.time))
    assert np.degrees(np.sqrt(model.estimated(rows).numbers[0, 0])) == pytest.approx(
        0.3
    )
    recorded = np.arange(len(log.time)) % 2 == 0
    slower = Problem(free.settings, [replace(log, recorded=recorded)])
    np.testing.assert_array_equal(make_error_model(slower).used, recorded)


def test_stage_1_takes_its_errors_for_white_noise():
    settings = load_settings("article-mech")
    log = noisy(
        simulate_log(settings, stepped(settings, TRUTH, [60.0, -40.0]), TRUTH),
        0.1,
        exact_start=False,
    )
    problem = Problem(settings, [log])
    theta = problem.parameters.vector(TRUTH, "truth")
    likelihood = likelihood_at(problem, theta)
    assert not likelihood.errors.numbers[:, 1:4].any()
    errors = problem.output_errors(theta[None])[0]
    weighed = likelihood.innovations(theta[None])[0]
    np.testing.assert_allclose(
        weighed * (errors @ errors) / (weighed @ errors), errors, atol=1e-12
    )
    # errors that last tell no more than independent ones
    assert np.mean(weighed**2) <= 1.0 + 1e-9


def test_weights_of_joints_count_in_stage_1():
    """Least squares of stage 1 minimises weighted output errors, whatever the errors of
    each joint."""
    settings = load_settings(
        "article-mech", {"outputs": [2, 3], "objective.weights": {3: 0.2}}
    )
    log = noisy(stepped(settings, TRUTH, [60.0, -40.0]), 0.1, exact_start=False)
    problem = Problem(settings, [log])
    theta = problem.parameters.vector(TRUTH, "truth")[None]
    likelihood = likelihood_at(problem, 1.1 * theta[0])
    level = (
        1.0 / likelihood.errors.innovations(np.ones((1, problem.measured.size)))[0, 0]
    )
    for one in (theta, 1.2 * theta):
        errors = problem.output_errors(one)
        np.testing.assert_allclose(
            likelihood.innovations(one) * level, errors, atol=1e-12
        )


def test_a_likelihood_adds_the_priors_scores_and_falls_as_its_rows_grow():
    problem = hydraulic(priors={"area": {"of": "A_A", "value": 900.0, "sd": 90.0}})
    likelihood, theta = make_likelihood(problem), problem.parameters.start[None]
    rows = likelihood.rows(theta)
    np.testing.assert_array_equal(rows[:, -1:], problem.priors.scores(theta))
    assert rows.shape == (1, problem.measured.size + 1)
    more = rows[0].copy()
    more[-1] += 1.0
    change = likelihood.negative_log(more) - likelihood.negative_log(rows[0])
    assert change == pytest.approx(0.5 * (more[-1] ** 2 - rows[0, -1] ** 2))
    twice = np.append(2.0 * rows[0, :-1], rows[0, -1])
    rise = likelihood.negative_log(twice) - likelihood.negative_log(rows[0])
    assert rise == pytest.approx(problem.measured.size * np.log(2.0))
