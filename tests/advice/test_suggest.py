"""Suggestions on simulated logs of which the truth is known."""

from dataclasses import replace

import numpy as np
import pytest
from conftest import step_log

from hydroid import load_settings
from hydroid.advice.actions import next_actions
from hydroid.advice.missing import Verdict, missing_terms
from hydroid.advice.proposals import advice, setting_line
from hydroid.advice.residuals import Regressor, residual_checks
from hydroid.advice.terms import ExtendedModel, terms
from hydroid.log import Log
from hydroid.posterior.covariance import Uncertainty, uncertainty
from hydroid.posterior.open_start import with_open_start
from hydroid.posterior.posterior import regular
from hydroid.prediction import simulate_log
from hydroid.problem.problem import Problem
from hydroid.quantity_table import QUANTITIES, ROWS, TARGETS
from hydroid.settings.fit import FitSettings
from hydroid.settings.problem import ParameterSettings

TRUTH = {"A_A": 1000.0, "A_B": 750.0, "D": 150.0}
LEVELS = [0.0, 60.0, -40.0, 80.0, -70.0, 30.0, -20.0, 50.0]


def make_settings(**hydraulics: float) -> FitSettings:
    """Stage 2 of the shoulder, areas and damping free."""
    settings = load_settings("fit-hyd", {f"hydraulics.{name}": v for name, v in hydraulics.items()})
    quantities = {"A_A": "area_a", "A_B": "area_b", "D": "damping"}
    free = {
        name: ParameterSettings(quantity=quantity, joints=(2,), bounds=(0.2 * TRUTH[name], 5 * TRUTH[name]))
        for name, quantity in quantities.items()
    }
    return settings.model_copy(update={"parameters": free})


def make_log(settings: FitSettings, noise_deg: float = 0.1) -> Log:
    log = simulate_log(settings, step_log(settings.arm.pose("study"), LEVELS, joint=2), TRUTH, "truth")
    noise = np.random.default_rng(1).normal(0.0, np.radians(noise_deg), log.angle.shape)
    noise[:, np.arange(log.joints) != 1] = 0.0
    return replace(log, angle=log.angle + noise)


def at_truth(truth: FitSettings, model: FitSettings) -> tuple[Problem, Uncertainty]:
    problem = Problem(model, [make_log(truth)])
    return problem, uncertainty(problem, problem.parameters.vector(TRUTH, "truth"))


@pytest.fixture(scope="module")
def late() -> tuple[Problem, Uncertainty]:
    """A model without the delay that its log has."""
    return at_truth(make_settings(delay=0.03), make_settings())


def test_every_quantity_that_is_switched_off_by_default_is_tested():
    settings = load_settings("fit-hyd")
    off = [n for n in QUANTITIES if getattr(settings.hydraulics, n, 1.0) in (0.0, None)]
    tested = {target for row in ROWS if row.span for target in TARGETS[row.name]}
    # what acts only at a stop (tested below), and what is 0 in nature
    assert set(off) - tested <= {"trapped_pressure"}


def test_terms_are_what_is_not_free(late: tuple[Problem, Uncertainty]):
    problem, _ = late
    names = {term.name for term in terms(problem)}
    assert {"delay", "delay_a", "delay_b", "overlap", "leakage", "dry_friction", "stiffness"} <= names
    assert not {"damping", "area_a", "area", "pump_flow"} & names
    free = {"late": ParameterSettings(quantity="delay_a", joints=(2,), bounds=(0, 1))}
    freed = {term.name for term in terms(problem.varied(problem.settings.with_parameters(free)))}
    assert freed & {"delay", "delay_a", "delay_b"} == {"delay_b"}
    (log,) = problem.logs
    gauged = replace(log, pressure=np.zeros((*log.angle.shape, 2)))
    assert "start_pressure" in names
    assert "start_pressure" not in {term.name for term in terms(Problem(problem.settings, [gauged]))}


def test_an_unchanged_term_changes_nothing_and_a_changed_one_what_it_sets(late: tuple[Problem, Uncertainty]):
    problem, known = late
    model, opened = ExtendedModel(problem, known.theta), with_open_start(problem, known.theta)
    np.testing.assert_array_equal(model.residual, opened.residuals(known.theta[None])[0])
    i = [term.name for term in model.terms].index("delay")
    changed = model.residuals(known.theta[None], [i], [0.03 / 2.0])[0]
    delayed = Problem(make_settings(delay=0.03), problem.logs).with_open_starts(opened.open_starts)
    right = delayed.residuals(known.theta[None])[0]
    np.testing.assert_allclose(changed, right, atol=1e-12)


def test_a_missing_delay_is_named_with_its_value_and_a_line_that_frees_it(late: tuple[Problem, Uncertainty]):
    result = missing_terms(*late)
    first = result.tests[0]
    assert (first.term.name, first.verdict) == ("delay", Verdict.FREE)
    assert first.value == pytest.approx(0.03, rel=0.1)
    assert np.degrees(first.rms) == pytest.approx(0.1, rel=0.05)
    assert setting_line(first).startswith("delay: {quantity: delay, joints: [2], bounds: [0.0, 0.1")


def test_nothing_is_named_where_nothing_is_missing():
    problem, known = at_truth(make_settings(), make_settings())
    result = missing_terms(problem, known, thorough=False)
    assert result.free == ()
    assert result.tests


def test_a_residual_that_depends_on_the_command_is_described(late: tuple[Problem, Uncertainty]):
    problem, known = late
    error = np.where(problem.logs[0].command[:, 1] > 55.0, 0.004, 0.0)
    residual = np.random.default_rng(2).normal(0.0, 0.001, len(error)) + error
    biased = replace(known, jacobian=replace(known.jacobian, residual=residual))
    (check,) = residual_checks(problem, biased)
    place = check.binned[Regressor.COMMAND].clearest(check.rms)
    assert place is not None
    assert check.binned[Regressor.COMMAND].mean[place] == pytest.approx(0.004, rel=0.1)
    assert not check.at_stop.any()
    noise = replace(known, jacobian=replace(known.jacobian, residual=residual - error))
    (silent,) = residual_checks(problem, noise)
    assert all(binned.clearest(silent.rms) is None for binned in silent.binned.values())


def test_stating_a_value_leaves_it_as_stated_and_helps_what_goes_with_it(late: tuple[Problem, Uncertainty]):
    problem, known = late
    # two parameters of which only the sum is known well
    root = np.array([[100.0, 100.0, 0.0], [0.5, -0.5, 0.0], [0.0, 0.0, 50.0]])
    difference = {"difference": np.array([1.0, -1.0, 0.0])}
    actions = next_actions(
        problem,
        replace(known, posterior=replace(known.posterior, root=regular(root))),
        difference,
        simulate=False,
    )
    assert {action["action"] for action in actions} == {"state"}
    assert {action["of"] for action in actions} == {"A_A", "A_B"}
    for action in actions:
        assert (action["known_before"], action["known_after"]) == (1, 3)
        assert action["parameter"] in {"A_A", "A_B"} - {action["of"]}
        assert action["after_percent"] == pytest.approx(5, rel=0.05)
        # one up, the other down: twice what one of them is known to
        assert action["quantity"] == "difference"
        for when in ("before_percent", "after_percent"):
            assert action[f"quantity_{when}"] == pytest.approx(2 * action[when], rel=0.03)


def test_a_perfect_fit_and_one_at_its_bounds_are_tested_too(late: tuple[Problem, Uncertainty]):
    settings = make_settings()
    problem = Problem(settings, [make_log(settings, noise_deg=0.0)])
    known = uncertainty(problem, problem.parameters.vector(TRUTH, "truth"))
    content = advice(problem, known, thorough=False).content
    assert "free" not in {test["verdict"] for test in content["missing"]}
    held = tuple(replace(status, at_bound="lower") for status in known.status)
    assert missing_terms(problem, replace(known, status=held), thorough=False).free == ()
