"""A rung says which quantities its model lacks, and how finely it steps."""

from dataclasses import replace
from itertools import chain
from typing import get_args

import numpy as np
import pytest
from conftest import candidates
from hydroid.simulation.rolls import ROLLS
from made_logs import at_rest

from hydroid import load_settings
from hydroid.hydraulics.records import JOINT, nominal_joints
from hydroid.quantity_table import CHOICES, QUANTITIES
from hydroid.rungs import (
    CLIMBS,
    DYNAMIC,
    GAIN,
    QUASI_STATIC,
    RUNGS,
    Climb,
    Rung,
    rungs_of,
)
from hydroid.settings.hydraulics import HydraulicSettings
from hydroid.settings.problem import SimulationSettings
from hydroid.simulation import Simulation
from hydroid.simulation.scenario import Scenario

SWITCHED_ON = {
    "lever_slope": 0.1,
    "lever_bend": 0.1,
    "pilot_lag_a": 0.05,
    "dead_band_a": 10.0,
    "opening_lag": 0.05,
    "anticavitation": 1.0,
    "leakage": 0.05,
    "compensation": 0.5,
    "pump_flow": 4.0,
    "pump_droop": 40.0,
    "pump_idle": 0.5,
    "pump_delay": 0.1,
    "pump_rise": 0.1,
    "dry_friction": 5.0,
    "delay_b": 0.03,
    "sensor_lag": 0.03,
    "oil_frequency": 3.0,
    "oil_damping_share": 0.3,
    "trapped_pressure": 20.0,
    "engine_exponent": 0.5,
    "temperature_effect": 1.0,
}
"""what is off by default, so that it can have an effect"""
NAMES = [name for name in QUANTITIES if name in (JOINT.names or ())]
CYLINDER, MOTOR = 1, 3


@pytest.fixture(scope="module")
def acting(arm, spec) -> dict[str, set[str]]:
    """The quantities that change what a rung simulates, by its name.

    Each is raised by a tenth, of a cylinder that starts at its stop and of a rotary
    actuator.
    """
    command = np.zeros((150, 7))
    command[10:80, CYLINDER] = 80
    command[80:, CYLINDER] = -60
    command[20:, MOTOR] = 60
    pose = arm.pose("study")
    pose[CYLINDER] = arm.lower[CYLINDER]
    slow_and_warm = np.tile([0.8, 10.0], (len(command), 1))
    log = replace(at_rest(pose, command), conditions=slow_and_warm)
    everyone = candidates(arm, 1 + len(NAMES))
    everyone.mass[:] = arm.masses
    everyone.joints[:] = nominal_joints(arm, HydraulicSettings(**SWITCHED_ON))
    for name, value in (("gain", 5.0), ("damping", 100.0), ("stiffness", 20.0)):
        everyone.joints[name] = value
    everyone.joints.friction[:] = 2.0
    for row, name in enumerate(NAMES, 1):
        value = everyone.joints[name][row]
        everyone.joints[name][row] = np.where(np.isfinite(value), 1.1 * value, 1e6)
    acts = {}
    for rung in RUNGS.values():
        scenario = Scenario(
            spec,
            arm,
            log,
            [CYLINDER, MOTOR],
            SimulationSettings(),
            rung.stepping(1, 3),
        )
        plain, *changed = Simulation(scenario).simulate(everyone).angle
        assert np.isfinite(plain).all()
        acts[rung.name] = {
            name
            for name, angle in zip(NAMES, changed, strict=True)
            if not np.array_equal(angle, plain)
        }
    return acts


@pytest.mark.parametrize("rung", RUNGS.values(), ids=lambda rung: rung.name)
def test_what_a_rung_lacks_changes_no_bit(rung: Rung, acting: dict[str, set[str]]):
    assert not acting[rung.name] & rung.lacks


def test_what_acts_on_one_rung_and_not_on_the_other_is_what_the_other_lacks(
    acting: dict[str, set[str]],
):
    static, dynamic = acting["quasi-static"], acting["dynamic"]
    assert len(static & dynamic) > 30
    assert static - dynamic <= DYNAMIC.lacks
    assert dynamic - static <= QUASI_STATIC.lacks
    assert acting["gain"] == {"gain", "damping", "stiffness", "friction"}


def test_a_stage_climbs_its_rungs_or_stands_on_one():
    assert rungs_of("mech", "ladder") == rungs_of("mech", "dynamic") == (GAIN,)
    assert rungs_of("hyd", "ladder") == (QUASI_STATIC, DYNAMIC)
    for rung in (QUASI_STATIC, DYNAMIC):
        assert rungs_of("hyd", rung.name) == (rung,)
        settings = load_settings("fit-hyd", {"simulation.model": "ladder"}).on(rung)
        assert settings.rung is rung


def test_every_climb_has_a_name_in_settings_and_every_rung_a_climb():
    assert {*CLIMBS} == {*get_args(Climb)}
    assert {GAIN, *chain(*CLIMBS.values())} == {*RUNGS.values()}


def test_every_rung_rolls_and_every_quantity_has_a_rung():
    assert {*ROLLS} == {*RUNGS.values()}
    lost = [name for name in CHOICES if not any(r.has(name) for r in RUNGS.values())]
    assert lost == []
