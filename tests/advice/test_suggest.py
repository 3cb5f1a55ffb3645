"""Suggestions on simulated logs of which the truth is known."""

import re
from dataclasses import replace

import numpy as np
import pytest
from arms import BOOM
from made_logs import noisy, stepped
from recovery import refined
from two_joints import PARAMETERS, PERIOD, drive, two_joints

from hydroid import load_settings
from hydroid.advice.growth import Candidate, promising, score_terms
from hydroid.advice.suggestions import advice, next_actions, proposed
from hydroid.advice.terms import Term, terms
from hydroid.log import Log
from hydroid.posterior.posterior import regular
from hydroid.posterior.uncertainty import Uncertainty, uncertainty
from hydroid.problem.problem import Problem
from hydroid.progress import no_progress
from hydroid.quantity_table import QUANTITIES, ROWS, TARGETS
from hydroid.settings.fit import FitSettings
from hydroid.settings.problem import ParameterSettings

TRUTH = {"A_A": 1000.0, "A_B": 750.0, "D": 150.0}
LEVELS = [0.0, 60.0, -40.0, 80.0, -70.0, 30.0, -20.0, 50.0]


def make_settings(**hydraulics: float) -> FitSettings:
    changes: dict[str, object] = {"design.duration_s": 10}
    changes |= {f"hydraulics.{name}": v for name, v in hydraulics.items()}
    settings = load_settings("fit-hyd", changes)
    quantities = {"A_A": "area_a", "A_B": "area_b", "D": "damping"}
    free = {
        name: ParameterSettings(
            quantity=quantity, joints=(2,), bounds=(0.2 * TRUTH[name], 5 * TRUTH[name])
        )
        for name, quantity in quantities.items()
    }
    return settings.model_copy(update={"parameters": free})


def make_log(settings: FitSettings, noise_deg: float = 0.1) -> Log:
    return noisy(stepped(settings, TRUTH, LEVELS, 0.5), noise_deg, 1)


def at_truth(truth: FitSettings, model: FitSettings) -> tuple[Problem, Uncertainty]:
    problem = Problem(model, [make_log(truth)])
    return problem, uncertainty(problem, problem.parameters.vector(TRUTH, "truth"))


@pytest.fixture(scope="module")
def late() -> tuple[Problem, Uncertainty]:
    return at_truth(make_settings(delay=0.03), make_settings())


def test_every_quantity_that_is_switched_off_by_default_is_tested():
    settings = load_settings("fit-hyd")
    off = [n for n in QUANTITIES if getattr(settings.hydraulics, n, 1.0) in (0.0, None)]
    tested = {target for row in ROWS if row.span for target in TARGETS[row.name]}
    # what acts only at a stop, and what a fit chooses for each joint
    assert set(off) - tested <= {"trapped_pressure", "by_command"}


def test_terms_are_what_is_not_free(late: tuple[Problem, Uncertainty]):
    problem, known = late

    def names(problem: Problem, theta: np.ndarray = known.theta) -> set[str]:
        return {term.name for term in terms(problem, theta)}

    held = {
        "delay",
        "delay_a",
        "delay_b",
        "overlap",
        "leakage",
        "dry_friction",
        "stiffness",
    }
    assert held <= names(problem)
    assert not {"damping", "area_a", "area", "pump_flow"} & names(problem)
    for quantity, left in (("delay_a", "delay_b"), ("delay", "late_b")):
        free = {
            "late": ParameterSettings(quantity=quantity, joints=(2,), bounds=(0, 1))
        }
        freed = names(
            problem.varied(problem.settings.with_parameters(free)),
            np.append(known.theta, 0.0),
        )
        assert freed & {"delay", "delay_a", "delay_b", "late_b"} == {left}
    # a second name of what is free
    lag = ParameterSettings(quantity="pilot_lag", joints=(2,), bounds=(0, 1))
    lagging = problem.varied(problem.settings.with_parameters({"lag": lag}))
    assert "plunger_damping" in names(problem)
    assert "opening_lag" in names(lagging, np.append(known.theta, 0.0))
    assert "plunger_damping" not in names(lagging, np.append(known.theta, 0.0))
    (log,) = problem.logs
    gauged = replace(log, pressure=np.zeros((*log.angle.shape, 2)))
    assert "start_pressure" in names(problem)
    assert "start_pressure" not in names(Problem(problem.settings, [gauged]))


def test_an_unchanged_term_changes_nothing_and_a_changed_one_what_it_sets(
    late: tuple[Problem, Uncertainty],
):
    problem, known = late
    every, likelihood = terms(problem, known.theta), known.likelihood
    as_it_is = likelihood.innovations(known.theta[None])
    for term in (one for one in every if np.isfinite(one.value)):
        np.testing.assert_array_equal(
            term.innovations(likelihood, known.theta, [term.value]), as_it_is
        )
    (delay,) = (term for term in every if term.name == "delay")
    delayed = Problem(make_settings(delay=0.03), problem.logs)
    right = likelihood.errors.innovations(delayed.output_errors(known.theta[None]))
    np.testing.assert_allclose(
        delay.innovations(likelihood, known.theta, [0.03]), right, atol=1e-9
    )


def test_a_missing_delay_is_found_and_lowers_the_error_on_parts_left_out(
    late: tuple[Problem, Uncertainty],
):
    problem, known = late
    content, _ = advice(problem, known, "runs/late", no_progress)
    first = content["terms"][0]
    assert first["name"] == "delay"
    assert first["freed"] == pytest.approx(0.03, rel=0.1)
    assert first["left_out_deg"]["shoulder"] == pytest.approx(0.1, rel=0.05)
    assert content["left_out_deg"]["shoulder"] > 0.14
    assert first["parameters"]["delay"]["bounds"][0] == 0.0
    assert (
        "--start runs/late --set 'parameters.delay={quantity: delay, joints: [2]"
        in first["command"]
    )
    assert {action["action"] for action in content["actions"]} <= {
        "state",
        "experiment",
    }


@pytest.mark.parametrize(
    ("quantity", "span", "held", "value", "bounds"),
    [
        ("delay", (0.0, 1.0), 0.0, 0.02, [0.0, 0.1]),
        ("lever_bend", (-0.5, 0.5), 0.0, -0.296, [-0.5, 0.0]),
        ("lever_bend", (-0.5, 0.5), 0.0, 0.05, [0.0, 0.25]),
        ("flow_limit", (1.0, 100.0), np.inf, 40.0, [8.0, 100.0]),
        ("opening_exponent", (0.1, 10.0), 1.0, 0.4, [0.1, 2.0]),
    ],
)
def test_a_proposed_term_begins_at_what_was_found_within_its_bounds(
    quantity, span, held, value, bounds
):
    entry = ParameterSettings(quantity=quantity, joints=(2,), bounds=span)
    term = Term("bend", {"bend": entry}, held)
    row = proposed(Candidate(term, value, 5.0, 0.0, 9.0), value)["bend"]
    assert row["bounds"] == bounds
    assert row["start"] == value


def test_a_parameter_that_differs_between_the_sides_is_split():
    model = make_settings()
    shared = ParameterSettings(quantity="delay", joints=(2,), bounds=(0.0, 0.2))
    truth, model = (
        make_settings(delay_a=0.02, delay_b=0.05),
        model.with_parameters({"late": shared}),
    )
    problem = Problem(model, [make_log(truth)])
    start = problem.parameters.vector(TRUTH | {"late": 0.035}, "start")
    known = uncertainty(problem, refined(problem, start))
    best = promising(score_terms(problem, known, no_progress))[0]
    assert best.term.name == "late_b"
    split = {name: p.quantity for name, p in best.term.entries.items()}
    assert split == {"late": "delay_a", "late_b": "delay_b"}
    more = best.term.added_to(problem)
    freed = refined(more, best.term.theta(problem, start, best.start))
    found = more.parameters.mapping(freed)
    assert (found["late"], found["late_b"]) == (
        pytest.approx(0.02, abs=2e-3),
        pytest.approx(0.05, abs=2e-3),
    )


@pytest.mark.parametrize("noise_deg", [0.0, 0.1])
def test_nothing_is_named_where_nothing_is_missing(noise_deg: float):
    settings = make_settings()
    problem = Problem(settings, [make_log(settings, noise_deg)])
    tests = score_terms(
        problem,
        uncertainty(problem, problem.parameters.vector(TRUTH, "truth")),
        no_progress,
    )
    assert tests
    assert promising(tests) == []


def test_stating_a_value_leaves_it_as_stated_and_helps_what_goes_with_it(
    late: tuple[Problem, Uncertainty],
):
    problem, known = late
    # two parameters of which only the sum is known well
    root = np.array([[100.0, 100.0, 0.0], [0.5, -0.5, 0.0], [0.0, 0.0, 50.0]])
    known = replace(known, posterior=replace(known.posterior, root=regular(root)))
    stated = [
        action for action in next_actions(problem, known) if action["action"] == "state"
    ]
    assert {action["of"] for action in stated} == {"A_A", "A_B"}
    for action in stated:
        assert action["parameter"] in {"A_A", "A_B"} - {action["of"]}
        assert action["after_percent"] == pytest.approx(5, rel=0.05)


@pytest.mark.parametrize(
    ("turns", "stated"), [("-40 60", {"flow"}), ("-180 180", {"flow", "size"})]
)
def test_no_data_sheet_has_the_size_of_what_stands_in_for_a_cylinder(
    tmp_path, turns: str, stated: set[str]
):
    """A rotary actuator is one where a cylinder may turn its joint: of a slewing gear
    it is a motor, which has a data sheet, as has the pump."""
    model = re.sub(
        r'(name="lift" axis="[^"]*") range="[^"]*"', rf'\1 range="{turns}"', BOOM
    )
    free = {
        "size": {"quantity": "area", "joints": [1], "within": 5},
        "flow": PARAMETERS["flow"],
    }
    settings = two_joints(tmp_path, model, parameters=free)
    problem = Problem(settings, [drive(two_joints(tmp_path))])
    known = uncertainty(problem, problem.parameters.start)
    # both together are known well, and each of them badly
    root = np.array([[100.0, 100.0], [0.5, -0.5]])
    known = replace(known, posterior=replace(known.posterior, root=regular(root)))
    actions = next_actions(problem, known)
    assert {a["of"] for a in actions if a["action"] == "state"} == stated


def test_levers_change_with_the_angle_only_where_a_cylinder_may_turn_the_joint(
    tmp_path,
):
    """Not on a cylinder of known pivots, nor on a slewing gear; whether it is stated or
    not."""

    def named(joint: str, model: str = BOOM) -> set[str]:
        settings = two_joints(tmp_path, model)
        held = {
            "held": ParameterSettings(quantity="lever_bend", joints=(1,), fixed=0.0)
        }
        settings = settings.with_parameters(held)
        problem = Problem(settings, [drive(two_joints(tmp_path))])
        every = terms(problem, problem.parameters.start)
        return {term.name for term in every} & {
            f"lever_slope_{joint}",
            "lever_slope",
            "held",
        }

    assert named("lift") == {"lever_slope_lift", "lever_slope", "held"}
    slewing = re.sub(
        r'(name="lift" axis="[^"]*") range="[^"]*"', r'\1 range="-180 180"', BOOM
    )
    assert slewing != BOOM
    assert named("lift", slewing) == set()
    assert named("tilt", slewing) == {"lever_slope_tilt"}
    joints = load_settings("fit-hyd").arm.joints
    assert [joint.name for joint in joints if joint.has("lever_slope")] == ["roll"]
    assert not {"roll", "rotation"} & {
        joint.name for joint in joints if joint.has("pivot_angle")
    }


def test_an_effect_of_a_group_is_a_term_only_where_some_logs_are_in_it_and_others_not(
    tmp_path,
):
    day = {"quantity": "dead_band", "joints": [1], "sd": 3, "per": "other", "fixed": 0}
    for groups, expected in (
        ({}, False),
        ({"monday": "mon_*"}, False),
        ({"monday": "*_1.csv"}, True),
    ):
        log = {"period_s": PERIOD, "groups": groups}
        settings = two_joints(tmp_path, parameters=PARAMETERS | {"day": day}, log=log)
        problem = Problem(settings, [drive(settings, seed) for seed in (0, 1)])
        named = {term.name for term in terms(problem, problem.parameters.start)}
        assert ("day" in named) == expected
