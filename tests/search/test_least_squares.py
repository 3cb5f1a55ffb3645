import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from hydroid.search.descent import Descent, Ending, start
from hydroid.search.least_squares import least_squares, step
from hydroid.settings.search import RefinementSettings

SETTINGS = RefinementSettings()


def rosenbrock(points):
    x, y = (4 * points - 2).T
    return np.stack((10 * (y - x**2), 1 - x), axis=1)


def linear(singular, truth, rows=400, offset=0.0, seed=0):
    rng = np.random.default_rng(seed)
    left = np.linalg.qr(rng.normal(size=(rows, len(singular))))[0]
    right = np.linalg.qr(rng.normal(size=(len(singular), len(singular))))[0]
    matrix = left * singular @ right.T
    # einsum sums each row by itself, so that a batch is the same as its candidates, as
    # it is for a simulation
    return (lambda x: np.einsum("np,rp->nr", x - truth, matrix) + offset), matrix


def oscillator(points):
    """A response that depends on its parameters over several decades, and not on the
    last one at all."""
    t = np.linspace(0, 10, 300)
    gain, damping, stiffness, tail, _ = points.T[:, :, None]
    wave = np.exp(-(0.1 + damping) * t) * np.sin((1 + stiffness) * t)
    return gain * wave + 1e-4 * tail * np.cos(3 * t)


@pytest.mark.parametrize("start", [[0.2, 0.9], [0.0, 0.0], [1.0, 0.0], [0.01, 0.99]])
def test_finds_the_bottom_of_rosenbrocks_valley(start):
    result = least_squares(np.array(start), rosenbrock, SETTINGS)
    np.testing.assert_allclose(result.point, 0.75, atol=1e-9)
    assert result.ending.converged
    assert result.cost < 1e-18 < result.cost_before


@pytest.mark.parametrize("seed", range(4))
def test_a_curved_problem_over_six_decades_is_solved_too(seed):
    rng = np.random.default_rng(seed)
    truth = rng.uniform(0.3, 0.7, 6)
    residuals, _ = linear(10.0 ** -np.arange(0, 6), truth)

    def curved(x):
        return residuals(x + 0.5 * (x - truth) ** 2)

    result = least_squares(
        np.clip(truth + rng.uniform(-0.3, 0.3, 6), 0, 1), curved, SETTINGS
    )
    np.testing.assert_allclose(result.point, truth, atol=1e-8)


@pytest.mark.parametrize("unit", [2.0**-60, 2.0**-20, 2.0**30])
def test_the_unit_of_the_residual_does_not_matter(unit):
    residuals, _ = linear(10.0 ** -np.arange(0, 6), np.full(6, 0.4))
    start = np.linspace(0.3, 0.6, 6)
    here = least_squares(start, residuals, SETTINGS)
    there = least_squares(start, lambda x: unit * residuals(x), SETTINGS)
    assert (here.point == there.point).all()
    assert there.cost == unit**2 * here.cost
    assert (here.evaluations, here.ending) == (there.evaluations, there.ending)


def test_an_effect_that_is_only_rounding_is_none():
    truth = np.array([0.4, 0.6, 0.5])
    strong, _ = linear([3.0, 1.0], truth[:2])

    def residuals(x):
        # (r + a) - a rounds to multiples of 2^-46, and where it does so depends on the
        # third parameter
        noise = 64 + np.pi * x[:, 2:]
        return (strong(x[:, :2]) + noise) - noise

    start = np.array([0.2, 0.2, 0.313])
    probe = residuals(start + 2.0**-26 * np.array([[0, 0, 0], [0, 0, 1]]))
    assert (probe[0] != probe[1]).any()
    result = least_squares(start, residuals, SETTINGS)
    assert result.point[2] == start[2]
    np.testing.assert_allclose(result.point[:2], truth[:2], atol=1e-10)


@settings(deadline=None, max_examples=40)  # the first refinement of a process is slow
@given(seed=st.integers(0, 2**32), failing=st.floats(0, 1))
def test_never_worse_than_the_start_and_always_inside(seed, failing):
    rng = np.random.default_rng(seed)
    truth = rng.uniform(-0.3, 1.3, 3)
    mix = rng.normal(size=(3, 20))

    def residuals(x):
        rows = np.sin(3 * (x - truth)) @ mix + 0.01 * np.sin(
            40 * x.sum(axis=1, keepdims=True)
        )
        # scattered regions that cannot be simulated
        rows[np.cos(12 * x).sum(axis=1) > 3 - 2 * failing] = np.nan
        return rows

    start = rng.random(3)
    result = least_squares(start, residuals, RefinementSettings(iterations=20))
    before = 0.5 * float((residuals(start[None]) ** 2).sum())
    if result.ending is Ending.START_FAILED:
        assert not np.isfinite(before)
        assert (result.point == start).all()
        return
    after = 0.5 * float((residuals(result.point[None]) ** 2).sum())
    assert result.cost_before == pytest.approx(before, rel=1e-12)
    assert result.cost == pytest.approx(after, rel=1e-12)
    assert result.cost <= result.cost_before
    assert ((result.point >= 0) & (result.point <= 1)).all()


def fails_beside_its_start(x):
    return np.where(x[:, :1] == 0.45, rosenbrock(x), np.nan)


def test_a_state_that_was_stored_goes_on_to_the_same_bits():
    truth = np.array([0.4, 0.3, 0.7, 0.6, 0.5])
    measured = oscillator(truth[None]) + 0.01 * np.random.default_rng(1).normal(
        size=300
    )

    def residuals(points):
        return measured - oscillator(points)

    at = np.array([0.5, 0.2, 0.6, 0.7, 0.2])
    state, stored, updated = start(at, residuals(at[None])[0]), [], 0
    while not state.ended:
        stored.append(state.arrays())
        state = step(state, residuals, SETTINGS)
        updated += len(state.jacobian) > 0 and not state.fresh
    assert updated > 0  # Broyden's updates were among them
    for arrays in stored:
        again = Descent.from_arrays(arrays)
        while not again.ended:
            again = step(again, residuals, SETTINGS)
        pairs = zip(again.arrays().values(), state.arrays().values(), strict=True)
        assert all((a == b).all() for a, b in pairs)


@settings(deadline=None)
@given(seed=st.integers(0, 2**32))
def test_a_box_is_never_left_and_its_optimum_found(seed):
    rng = np.random.default_rng(seed)
    residuals, matrix = linear(rng.uniform(0.1, 2, 5), rng.uniform(-1, 2, 5), seed=seed)
    seen = []

    def watched(x):
        seen.append(x)
        return residuals(x)

    result = least_squares(
        rng.random(5), watched, RefinementSettings(gain_tolerance=1e-14)
    )
    points = np.vstack(seen)
    assert ((points >= 0) & (points <= 1)).all()
    assert result.evaluations == len(points)
    # first-order conditions of a box: no slope inside, slope outwards on the bounds
    slope = matrix.T @ residuals(result.point[None])[0]
    low, high = result.point <= 1e-12, result.point >= 1 - 1e-12
    np.testing.assert_allclose(slope[~low & ~high], 0, atol=1e-6)
    assert (slope[high] <= 1e-6).all()
    assert (slope[low] >= -1e-6).all()


@pytest.mark.parametrize(
    ("function", "begin", "ending"),
    [
        (lambda x: np.full((len(x), 5), np.nan), [0.5, 0.5], Ending.START_FAILED),
        (fails_beside_its_start, [0.45, 0.3], Ending.JACOBIAN_FAILED),
        (lambda x: np.ones((len(x), 5)), [0.3, 0.8], Ending.GAIN),
    ],
)
def test_what_cannot_go_on_stays_at_its_start_and_says_why(
    function, begin, ending, capfd
):
    result = least_squares(np.array(begin), function, SETTINGS)
    assert result.ending is ending
    assert (result.point == begin).all()
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("seed", range(6))
def test_beside_an_edge_the_other_parameters_move_on(seed):
    """As where a machine leaves its stop a little later, and is then far off: what
    decides that has little effect else, and damping by effect hardly holds it."""
    rng = np.random.default_rng(seed)
    truth = rng.uniform(0.3, 0.7, 5)
    effect = np.array([1, 1, 0.01, 1, 1])
    of_effects, matrix = linear(np.geomspace(1, 0.1, 5), np.zeros(5), seed=seed)
    begun = np.clip(truth + rng.uniform(-0.2, 0.2, 5), 0, 1)
    begun[2] = truth[2] - 0.2
    edge = begun[2] + 1e-4

    def residuals(x):
        return np.where(x[:, 2:3] > edge, 1e3, of_effects((x - truth) * effect))

    result = least_squares(begun, residuals, SETTINGS)
    # the best of all points up to the edge lies on it
    curvature = np.linalg.inv((matrix * effect).T @ (matrix * effect))[2, 2]
    least = 0.5 * (truth[2] - edge) ** 2 / curvature
    assert result.cost < 1.001 * least


def test_iterations_run_out():
    result = least_squares(
        np.array([0.1, 0.9]), rosenbrock, RefinementSettings(iterations=2)
    )
    assert (result.ending, result.iterations) == (Ending.ITERATIONS, 2)
    assert result.cost < result.cost_before
