import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hydroid.errors import SettingsError
from hydroid.problem.norms import norm, overall_objective, relative_norm
from hydroid.settings.problem import ObjectiveSettings

ORDERS = [1, 2, "inf"]


@pytest.fixture
def error():
    return np.random.default_rng(3).normal(size=(9, 1001))


@pytest.mark.parametrize("p", ORDERS)
def test_is_the_limit_form_of_equation_18(error, p):
    power = 400 if p == "inf" else p
    literal = [sum(abs(e) ** power / len(row) for e in row) ** (1 / power) for row in error.tolist()]
    # N^(1/400) is what is left of the mean at p = 400
    rtol = 1001 ** (1 / 400) - 1 if p == "inf" else 1e-12
    np.testing.assert_allclose(norm(error, p), literal, rtol=rtol)


@pytest.mark.parametrize("p", ORDERS)
def test_norm_laws(error, p):
    a, b = error, error[::-1]
    np.testing.assert_allclose(norm(-3 * a, p), 3 * norm(a, p), rtol=1e-14)
    assert (norm(a + b, p) <= norm(a, p) + norm(b, p) + 1e-15).all()
    # a mean norm: seeing the same record twice changes nothing
    np.testing.assert_allclose(norm(np.hstack((a, a)), p), norm(a, p), rtol=1e-14)


def test_orders_are_ordered(error):
    one, two, most = (norm(error, p) for p in ORDERS)
    assert (one <= two).all()
    assert (two <= most).all()


@pytest.mark.parametrize("p", ORDERS)
@given(rows=st.lists(st.integers(0, 8), min_size=1, max_size=9), layout=st.sampled_from("CF"))
def test_a_member_is_scored_alike_in_any_company_bit_for_bit(p, rows, layout):
    error = np.random.default_rng(3).normal(size=(9, 1001))
    together = norm(np.asarray(error[rows], order=layout), p)
    alone = [norm(error[k : k + 1], p)[0] for k in rows]
    assert together.tolist() == alone


@pytest.mark.parametrize("p", ORDERS)
@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.filterwarnings("error")
def test_a_row_that_is_not_finite_is_infinitely_bad_and_the_others_are_not(error, p, bad):
    broken = error.copy()
    broken[4, 700] = bad
    value = norm(broken, p)
    assert value[4] == np.inf
    others = np.arange(9) != 4
    assert (value[others] == norm(error, p)[others]).all()


@pytest.mark.filterwarnings("error")
def test_overflow_is_infinitely_bad():
    assert norm(np.full((1, 3), 1e200), 2)[0] == np.inf


@pytest.mark.parametrize("p", ORDERS)
def test_relative_norm_has_no_unit(error, p):
    measured = np.sin(np.arange(1001) / 50)
    value = relative_norm(error, measured, p)
    degrees = relative_norm(np.rad2deg(error), np.rad2deg(measured), p)
    np.testing.assert_allclose(value, degrees, rtol=1e-13)
    # a model that never moves is wrong by all there is to know
    assert relative_norm(measured[None, :], measured, p)[0] == 1.0


def test_relative_norm_of_nothing_names_the_setting():
    with pytest.raises(SettingsError, match=r"objective\.relative"):
        relative_norm(np.ones((2, 5)), np.zeros(5), 2)


def test_overall_objective_follows_the_settings(error):
    measured = np.linspace(1, 2, 1001)
    absolute = overall_objective(error, measured, ObjectiveSettings(norm=1))
    relative = overall_objective(error, measured, ObjectiveSettings(norm=1, relative=True))
    assert (absolute == norm(error, 1)).all()
    np.testing.assert_allclose(relative, absolute / 1.5, rtol=1e-13)
