"""A rung says which quantities its model lacks, and how finely it steps; its law, how
it moves and settles, an added one's too."""

# pyright: reportMissingParameterType=false
# a law takes whatever has its fields

import re
from dataclasses import replace
from itertools import chain
from typing import get_args

import numpy as np
import pytest
from conftest import candidates
from made_logs import at_rest
from made_models import EARLY, EARLY_SETTINGS, made_model

from hydroid import fit, load_settings
from hydroid.errors import SettingsError
from hydroid.hydraulics.cylinder import weigh
from hydroid.hydraulics.elementwise import compilable
from hydroid.hydraulics.joint import mean_opening
from hydroid.hydraulics.kernel import make_pad
from hydroid.hydraulics.records import JOINT, nominal_joints
from hydroid.identified_model import IdentifiedModel
from hydroid.plant import Plant, PlantBatch
from hydroid.posterior.bench import make_bench
from hydroid.problem.bindings import Bindings
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
from hydroid.simulation.laws import LAWS, Law
from hydroid.simulation.quasi_static import quasi_static_rod, roll_quasi_static
from hydroid.simulation.rollout import write_sample
from hydroid.simulation.scenario import Scenario
from hydroid.use.linear import linearise

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
HELD = {"shoulder": 40.0, "elbow": -50.0}


def acting_on(rung: Rung, arm, spec) -> set[str]:
    """The quantities that change what a rung simulates.

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
    how = SimulationSettings()
    joints = [CYLINDER, MOTOR]
    scenario = Scenario(spec, arm, log, joints, how, rung.stepping(1, 3))
    plain, *changed = Simulation(scenario).simulate(everyone).angle
    assert np.isfinite(plain).all()
    return {
        name
        for name, angle in zip(NAMES, changed, strict=True)
        if not np.array_equal(angle, plain)
    }


@pytest.fixture(scope="module")
def acting(arm, spec) -> dict[str, set[str]]:
    return {rung.name: acting_on(rung, arm, spec) for rung in RUNGS.values()}


@pytest.mark.parametrize("rung", RUNGS.values(), ids=lambda rung: rung.name)
def test_a_rung_lacks_what_changes_no_bit_and_acts_on_another_rung(
    rung: Rung, acting: dict[str, set[str]]
):
    assert not acting[rung.name] & rung.lacks
    anywhere = set[str]().union(*acting.values())
    assert len(anywhere) > 30
    assert anywhere - acting[rung.name] <= rung.lacks
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


def test_every_rung_has_a_law_and_every_quantity_a_rung():
    assert {*LAWS} == {*RUNGS.values()}
    lost = [name for name in CHOICES if not any(r.has(name) for r in RUNGS.values())]
    assert lost == []


def test_a_law_without_a_settled_rod_is_refused():
    with pytest.raises(TypeError, match="rod"):
        Law(roll_kinematic)  # pyright: ignore[reportCallIssue]


@compilable
def kinematic_rod(c, w, supply):
    """Oil flows as if the whole pressure fell over one edge, whatever the load is."""
    flow = c.conductance * w.open_area * np.sqrt(supply)
    return flow / (c.a.area if flow > 0.0 else c.b.area), abs(flow)


@compilable
def roll_kinematic(arm, plugin, state, course, trace):
    commands, followed, _, opening, _ = course
    steps = followed.shape[0]
    past = commands.shape[0] - steps
    work = make_pad(plugin.order.size).joints
    for k in range(steps):
        for a in range(plugin.idle, plugin.order.size):
            j = plugin.order[a]
            c = plugin.coefficients[j]
            z = state[j]
            w = work[j]
            column = arm.columns[j]
            angle = arm.angle[column]
            if opening.size:
                w.open_area = opening[k, j]
            else:
                w.open_area = mean_opening(c, z, w, commands[:, j], past + k, plugin)
            weigh(c, w, angle + 0.5 * plugin.period * z.velocity, 0.0)
            z.velocity = kinematic_rod(c, w, c.supply_pressure)[0] / w.arm
            arm.angle[column] = angle + plugin.period * z.velocity
        write_sample(arm, trace, state, k)


KINEMATIC = Rung(
    name="kinematic",
    stage="hyd",
    at_once=True,
    lacks=QUASI_STATIC.lacks
    | {
        *("damping", "stiffness", "friction", "dry_friction", "compensation"),
        *("flow_limit", "return_a", "return_b", "tank_pressure"),
        *("draw_a", "draw_b", "engine_exponent", "temperature_effect"),
        *("oil_frequency", "oil_damping", "oil_damping_share"),
        *(name for name in QUANTITIES if CHOICES[name].of_the_pump),
    }
    - {"supply_pressure"},
)
OTHER = replace(QUASI_STATIC, name="other")
ADDED = {
    KINEMATIC: Law(roll_kinematic, kinematic_rod),
    # a law that leaves to others what it need not say
    OTHER: Law(roll_quasi_static, quasi_static_rod),
}
PUMP = {"pump_flow": 3.0, "pump_droop": 60.0}
HYDRAULIC = [rung for rung in RUNGS.values() if rung.stage == "hyd"]
each_rung = pytest.mark.parametrize(
    "added", [*HYDRAULIC, *ADDED], ids=lambda rung: rung.name, indirect=True
)


def close_to(speed: np.ndarray, rung: Rung):
    """Settled speeds leave out what oil takes in because the load changes on the way."""
    return pytest.approx(speed, rel=1e-3 if rung.at_once else 2e-2)


@pytest.fixture(params=ADDED, ids=lambda rung: rung.name)
def added(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Rung:
    """A rung that is added as CONTRIBUTING says."""
    rung = request.param
    monkeypatch.setitem(RUNGS, rung.name, rung)
    monkeypatch.setitem(CLIMBS, rung.name, (rung,))
    monkeypatch.setitem(LAWS, rung, ADDED.get(rung) or LAWS[rung])
    return rung


def on(rung: Rung, **hydraulics: float) -> IdentifiedModel:
    model = made_model(EARLY, hydraulics=EARLY_SETTINGS | hydraulics)
    return replace(model, settings=model.settings.on(rung))


@each_rung
def test_plants_and_batches_of_a_rung_settle_to_its_speeds(added: Rung):
    plant, alone = (Plant(on(added, **PUMP), joints=[2, 3]) for _ in range(2))
    batch = PlantBatch([alone])
    held = np.array([HELD.get(name, 0.0) for name in plant.names])
    angles = []
    for _ in range(150):
        angles.append(plant.step(held))
        assert np.array_equal(batch.step(held)[0], angles[-1])
    before, here, after = angles[-3:]
    settled = plant.speeds(HELD, at=here)
    assert np.abs(settled[[1, 2]]).min() > 0.01
    assert (after - before) / (2 * plant.period) == close_to(settled, added)
    assert plant.commands(settled, at=here).command == pytest.approx(held, rel=1e-4)


@each_rung
def test_the_bench_of_a_rung_has_its_speeds(added: Rung):
    model = on(added, **PUMP)
    one = Bindings(model.settings).candidates(model.theta[None])
    arm = model.settings.arm
    log = at_rest(arm.pose("study"), np.zeros((2, len(arm.joints))))
    bench = make_bench(model.settings, [log], 2)
    movement = bench.movement(40.0, seconds=1.5)
    angles = movement.angles(one)
    *_, before, after = movement.speeds_of(angles)[0]
    there = replace(bench, angle=float(angles[0, -2]))
    speed = there.steady(one, np.array([40.0]), there.loads(one))[0, 0]
    assert abs(speed) > 1.0  # deg/s
    assert (before + after) / 2 == close_to(movement.sign * speed, added)


def test_a_linear_arm_has_no_oil_where_an_added_rung_has_none(added: Rung):
    plant = Plant(on(added, oil_frequency=3.0), joints=[2, 3])
    held = np.array([HELD.get(name, 0.0) for name in plant.names])
    has_oil = any("acceleration" in state for state in linearise(plant, held).states)
    assert has_oil == added.has("oil_frequency")


def test_what_an_added_rung_lacks_is_told_from_what_it_has(
    added: Rung, acting: dict[str, set[str]], arm, spec
):
    acts = acting_on(added, arm, spec)
    assert not acts & added.lacks
    assert set[str]().union(*acting.values()) - acts <= added.lacks


@pytest.mark.parametrize("quantity", ["leakage", "bulk_modulus"])
def test_a_fit_refuses_to_estimate_what_its_model_lacks(added: Rung, quantity: str):
    entry = {"parameters.K": {"quantity": quantity, "within": 2}}
    settings = load_settings("fit-hyd", entry)
    settings = settings.changed({"parameters": {"K": settings.parameters["K"]}})
    text = f"parameters.K: the model {added.name} has no {quantity}; leave it out"
    with pytest.raises(SettingsError, match=re.escape(text)):
        fit(settings.on(added), "none.csv")
