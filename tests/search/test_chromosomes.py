import numpy as np
import pytest
from hypothesis import given, strategies as st
from hypothesis.extra.numpy import arrays

from hydroid.search.chromosomes import (
    GrayCoding,
    IntegerCoding,
    crossover,
    mutate,
    pointwise_swaps,
    roulette,
)
from hydroid.settings.search import GeneticSettings

KINDS = [GrayCoding, IntegerCoding]
STEP = 1 / 65535
EVERY = np.arange(65536)[:, None] / 65535


@pytest.mark.parametrize("kind", KINDS)
@given(points=arrays(float, (4, 3), elements=st.floats(0, 1)))
def test_encode_is_nearest_and_decode_its_inverse(kind, points):
    coding = kind(3)
    chromosomes = coding.encode(points)
    assert chromosomes.shape == (4, 3 * coding.width)
    assert np.abs(coding.decode(chromosomes) - points).max() <= STEP / 2 * (1 + 1e-9)
    assert (coding.encode(coding.decode(chromosomes)) == chromosomes).all()


def test_neighbouring_values_differ_in_one_bit():
    bits = GrayCoding(1).encode(EVERY)
    assert (np.count_nonzero(bits[1:] != bits[:-1], axis=1) == 1).all()


@pytest.mark.parametrize("kind", KINDS)
def test_random_points_are_uniform(kind):
    coding = kind(2)
    points = coding.decode(coding.random(20_000, np.random.default_rng(5)))
    counts = np.histogram(points, bins=50, range=(0, 1))[0]
    expected = points.size / 50
    chi2 = ((counts - expected) ** 2 / expected).sum()
    # five standard deviations of chi-square with 49 degrees
    assert chi2 < 49 + 5 * np.sqrt(2 * 49)


INF, NAN = np.inf, np.nan


@pytest.mark.parametrize(
    ("objective", "fitness"),
    [
        ([1.0, 2.0, 4.0, 4.5, 5.0, INF], [4.0, 3.0, 1.0, 0.5, 0.0, 0.0]),
        # equally likely where fitness cannot tell
        ([3, 3, 3, 3], [1, 1, 1, 1]),
        ([INF, NAN, -INF], [1, 1, 1]),
        ([INF, 7, NAN], [0, 1, 0]),
        ([2, INF, 2], [1, 0, 1]),
    ],
)
def test_candidates_are_drawn_in_proportion_to_their_fitness(objective, fitness):
    index = roulette(
        np.array(objective, dtype=float)[:, None], 50_000, np.random.default_rng(11)
    )
    counts, drawn = np.bincount(index, minlength=len(objective)), np.array(fitness) > 0
    assert counts[~drawn].sum() == 0
    expected = (np.array(fitness) / np.sum(fitness) * counts.sum())[drawn]
    # chi-square, 3 degrees, p = 0.001
    assert ((counts[drawn] - expected) ** 2 / expected).sum() < 16.3


@given(st.integers(1, 6), st.integers(1, 40), st.integers(1, 50), st.integers(0, 999))
def test_n_point_crossover_makes_n_cuts(pairs, length, points, seed):
    swaps = pointwise_swaps(pairs, length, points, np.random.default_rng(seed))
    cuts = np.count_nonzero(swaps[:, 1:] != swaps[:, :-1], axis=1)
    assert (cuts == min(points, length - 1)).all()
    assert not swaps[:, 0].any()


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("cross", ["pointwise", "uniform"])
@given(rate=st.floats(0, 1), seed=st.integers(0, 2**32))
def test_crossover_only_exchanges_the_genes_of_a_pair(kind, cross, rate, seed):
    rng = np.random.default_rng(seed)
    parents = kind(4).random(10, rng)
    parents.flags.writeable = False
    children = crossover(
        parents, GeneticSettings(crossover=cross, crossover_rate=rate), rng
    )
    assert children.dtype == parents.dtype
    pair = np.sort(parents.reshape(5, 2, -1), axis=1)
    assert (np.sort(children.reshape(5, 2, -1), axis=1) == pair).all()


def test_the_crossover_rate_is_the_share_of_pairs_that_cross():
    coding = IntegerCoding(200)
    rng = np.random.default_rng(0)
    parents = coding.random(4000, rng)
    children = crossover(
        parents, GeneticSettings(crossover="uniform", crossover_rate=0.8), rng
    )
    crossed = (children != parents).any(axis=1).reshape(-1, 2)
    assert (crossed[:, 0] == crossed[:, 1]).all()
    assert abs(crossed.mean() - 0.8) < 5 * np.sqrt(0.16 / 2000)
    assert (crossover(parents, GeneticSettings(crossover_rate=0), rng) == parents).all()


@pytest.mark.parametrize("kind", KINDS)
def test_the_mutation_rate_is_per_element(kind):
    coding = kind(9)
    rng = np.random.default_rng(0)
    parents = coding.random(5000, rng)
    parents.flags.writeable = False
    children = mutate(parents, 0.2, coding, rng)
    assert children.dtype == parents.dtype
    genes = (children != parents).reshape(-1, coding.width).sum(axis=1)
    assert genes.max() == 1
    assert abs((genes > 0).mean() - 0.2) < 5 * np.sqrt(0.16 / genes.size)
    assert (mutate(parents, 0.0, coding, rng) == parents).all()
