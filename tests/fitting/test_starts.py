"""Where least squares begins: valves and pumps of another kind."""

import numpy as np
import pytest
from made_logs import simulate_log, step_log
from recovery import settings_of
from small_fits import steps_of

from hydroid import load_settings
from hydroid.fitting.baselines import fit_baselines
from hydroid.fitting.multistart import alone
from hydroid.fitting.starts import (
    OPEN_CENTRE,
    by_numbers,
    with_open_centre,
    with_other_valve,
)
from hydroid.problem.problem import Problem

PUMP = {
    "P_droop": {"quantity": "pump_droop", "fixed": 120.0, "term": "pump"},
    "P_flow": {
        "quantity": "pump_flow",
        "nominal": 4.0,
        "within": 8,
        "start": 4.0,
        "term": "pump",
    },
    "P_power": {
        "quantity": "pump_exponent",
        "bounds": [1, 50],
        "start": 1.2,
        "term": "pump",
    },
    "P_past": {
        "quantity": "pump_bypass",
        "bounds": [0, 5],
        "start": 0.1,
        "term": "pump",
    },
}
OPENINGS = {
    f"open_{j}": {"quantity": "opening", "joints": [j], "nominal": 0.3, "within": 2}
    for j in (2, 3)
}
SHOULDER = (60, -40, 90, -80, 40, 0, -30, 70)
ELBOW = (-50, 80, -70, 50, 0, 60, -80, 40)


def with_pump(model: str) -> tuple[Problem, Problem]:
    """A problem without the term of a shared pump, and the same with it."""
    settings = settings_of(OPENINGS | PUMP).changed(
        {"outputs": (2, 3), "simulation.model": model}
    )
    machine = settings.of_estimate("refined")
    log = step_log(machine.arm.pose("study"), {2: SHOULDER, 3: ELBOW})
    exact = simulate_log(machine, log, {"open_2": 0.35, "open_3": 0.3})
    before = Problem(machine, [exact])
    return before, before.varied(settings.of_estimate("refined+pump"))


def test_a_pump_that_is_new_begins_on_open_centres_and_nothing_else_is_changed():
    before, after = with_pump("quasi-static")
    theta = after.parameters.start
    start = with_open_centre(after, before, theta)
    assert start is not None
    values = after.parameters.mapping(start)
    assert values["P_power"] == OPEN_CENTRE["pump_exponent"]
    assert values["P_past"] == OPEN_CENTRE["pump_bypass"]
    changed = np.flatnonzero(start != theta)
    assert {after.parameters.names[i] for i in changed} == {"P_power", "P_past"}


def test_no_open_centre_is_tried_where_there_was_a_pump_or_where_joints_have_inertia():
    before, after = with_pump("quasi-static")
    theta = after.parameters.start
    assert with_open_centre(after, after, theta) is None
    assert with_open_centre(before, before, before.parameters.start) is None
    before, after = with_pump("dynamic")
    assert with_open_centre(after, before, theta) is None


VALVE = {
    "compensation_2": {
        "quantity": "compensation",
        "joints": [2],
        "bounds": [0, 1],
        "start": 0.2,
    },
    "slope_2": {
        "quantity": "lever_slope",
        "joints": [2],
        "bounds": [-0.5, 0.5],
        "start": 0.1,
    },
    "area_2": {"quantity": "area", "joints": [2], "nominal": 10.0, "within": 3},
    "open_3": OPENINGS["open_3"],
}


@pytest.mark.parametrize(("has", "gets"), [(0.1, 1.0), (0.5, 1.0), (0.9, 0.0)])
def test_the_other_valve_minds_a_load_where_this_one_does_not(has, gets):
    settings = settings_of(VALVE).changed({"outputs": (2, 3)})
    values = {"compensation_2": has, "slope_2": 0.3, "area_2": 25.0, "open_3": 0.4}
    log = step_log(settings.arm.pose("study"), {2: SHOULDER, 3: ELBOW})
    problem = Problem(settings, [simulate_log(settings, log, values)])
    theta = problem.parameters.vector(values, "here")
    other = problem.parameters.mapping(with_other_valve(problem, 2, theta))
    assert other["compensation_2"] == gets
    assert other["slope_2"] == 0.0
    assert (
        other["area_2"]
        == problem.parameters.mapping(problem.parameters.start)["area_2"]
    )
    # another joint's
    assert other["open_3"] == 0.4


def test_a_start_takes_a_valve_that_no_load_slows_from_nine_numbers():
    true = {"delay": 0.12, "dead_band": 25.0, "compensation": 1.0, "opening_lag": 0.05}
    most = {"delay": 0.5, "dead_band": 60.0, "compensation": 1.0, "opening_lag": 0.5}
    rows = {
        f"{name}_{j}": {"quantity": name, "joints": [j], "bounds": [0.0, most[name]]}
        for name in true
        for j in (2, 3)
    }
    coil = {
        "hydraulics.current_min": 0.8,
        "hydraulics.slot_width": 0.33,
        "hydraulics.onset": 0.0,
    }
    changes = {
        "parameters": rows,
        "outputs": [2, 3],
        "simulation.model": "quasi-static",
    }
    settings = load_settings("fit-hyd", changes | coil)
    levels = [100.0, -90.0, 60.0, -50.0, 80.0, -70.0, 40.0, -100.0]
    values = {f"{name}_{j}": value for name, value in true.items() for j in (2, 3)}
    problem = Problem(settings, [steps_of(settings, values, {2: levels, 3: levels})])
    lowest = problem.parameters.lower
    own = alone(problem, 2, lowest)
    ends = [*settings.arm.ranges.values()][1]
    nine_numbers = fit_baselines(own.logs, 2, ends)["nine numbers"]
    start = problem.parameters.mapping(by_numbers(own, 2, lowest, nine_numbers))
    for name, near in {
        "delay": 0.03,
        "dead_band": 5.0,
        "compensation": 0.0,
        "opening_lag": 0.03,
    }.items():
        assert start[f"{name}_2"] == pytest.approx(true[name], abs=near)
        assert start[f"{name}_3"] == 0.0
