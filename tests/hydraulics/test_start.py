"""How a machine stood: oil trapped in the chambers, a stop that carries the rest,
pressures from the log."""

from dataclasses import replace

import numpy as np
import pytest
from hydraulic_reference import START, cylinder, parameters, simulate, watched
from made_logs import step_log
from recovery import STOPPED, settings_of

from hydroid.arm.model import load_model
from hydroid.problem.bindings import Bindings
from hydroid.settings.hydraulics import HydraulicSettings
from hydroid.simulation import make_simulation

TIGHT = HydraulicSettings(leakage=0.0, substeps=10)
TRAPPED = {
    "trapped": {"quantity": "trapped_pressure", "joints": [2], "bounds": [0.0, 150.0]}
}


@pytest.mark.parametrize("trapped", [0.0, 5.0, 30.0])
def test_a_joint_stands_on_its_stop_whatever_is_trapped(trapped: float):
    angle = simulate(parameters(TIGHT, trapped_pressure=trapped), np.zeros(1000), TIGHT)
    assert abs(angle - START).max() < 1e-9


def test_the_oil_must_first_be_pressed():
    """The flow of the valve compresses the trapped oil until it carries the load: V Δp
    / β."""
    angle, seen, _ = watched(
        parameters(TIGHT, trapped_pressure=5.0), np.full(200, 30.0), TIGHT
    )
    moved = int(np.argmax(angle - START > np.radians(0.1)))
    pressure, flow = seen.pressure[:moved, 0], seen.flow[:moved, 0]
    ends = cylinder(angle[[0, moved]])[0]
    compressed = (30e-6 + 1e-3 * ends[0]) * (pressure[-1] - 5e5) / 8e8
    swept = 1e-3 * (ends[1] - ends[0])
    assert 0.01 * flow.sum() == pytest.approx(compressed + swept, rel=0.05)
    assert compressed > 3 * swept


def test_a_stop_lets_go_and_holds_again():
    """Up from the stop, down onto it: the joint comes to rest where it began."""
    command = np.repeat([60.0, -60.0], [100, 400])
    angle = simulate(parameters(TIGHT, trapped_pressure=5.0), command, TIGHT)[0]
    assert angle.max() - START > np.radians(3)
    assert angle.min() - START > -np.radians(0.2)
    assert abs(angle[-50:] - START).max() < np.radians(0.2)
    assert abs(np.diff(angle[-50:])).max() < 1e-5
    free = simulate(parameters(TIGHT), command, TIGHT)[0]
    assert free[-1] < START - np.radians(1)


def test_more_than_the_load_presses_against_a_stop_above():
    up, down = ([u] * 100 for u in (60.0, -60.0))
    p = parameters(TIGHT, trapped_pressure=140.0)
    assert simulate(p, np.array(up), TIGHT)[0].max() - START < np.radians(0.2)
    assert simulate(p, np.array(down), TIGHT)[0].min() - START < -np.radians(1)


def test_a_log_says_in_which_pressures_it_rested():
    settings = settings_of(TRAPPED, start_pressure=None)
    log = step_log(STOPPED, {2: [0, 50]})
    pressure = np.full((len(log.time), 7, 2), np.nan)
    pressure[:, 1] = 12e5, 3e5
    spec, bindings = load_model(settings.arm), Bindings(settings)
    for measured, wanted in ((None, (40e5, 50e5)), (pressure, (12e5, 3e5))):
        simulation = make_simulation(
            spec, replace(log, pressure=measured), [1], settings, [1]
        )
        response = simulation.simulate(
            bindings.candidates(np.array([[231.8, 53.4, 40.0]]))
        )
        np.testing.assert_allclose(response.pressure[0, 0, 0], wanted)


def test_a_joint_away_from_its_stops_is_held_by_its_oil():
    settings = settings_of(TRAPPED)
    log, bindings = (
        step_log(settings.arm.pose("study"), {2: [50, -50]}),
        Bindings(settings),
    )
    simulation = make_simulation(load_model(settings.arm), log, [1], settings)
    angle = simulation.simulate(
        bindings.candidates(np.array([[231.8, 53.4, p] for p in (0.0, 40.0)]))
    ).angle
    np.testing.assert_array_equal(angle[0], angle[1])
