import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from hydroid.search.coding import GrayCoding, IntegerCoding

KINDS = [GrayCoding, IntegerCoding]
STEP = 1 / 65535
EVERY = np.arange(65536)[:, None] / 65535


@pytest.mark.parametrize("kind", KINDS)
def test_every_value_goes_there_and_back(kind):
    coding = kind(1)
    assert (coding.decode(coding.encode(EVERY)) == EVERY).all()


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
    assert chi2 < 49 + 5 * np.sqrt(2 * 49)  # five standard deviations of chi-square with 49 degrees


def test_a_bit_flip_changes_one_bit_of_every_element():
    coding = GrayCoding(5)
    rng = np.random.default_rng(0)
    chromosomes = coding.random(2000, rng)
    flips = (coding.altered(chromosomes, rng) != chromosomes).reshape(-1, 16)
    assert (flips.sum(axis=1) == 1).all()
    counts = flips.sum(axis=0)
    expected = len(flips) / 16
    assert ((counts - expected) ** 2 / expected).sum() < 15 + 5 * np.sqrt(30)
