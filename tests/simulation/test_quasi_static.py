"""The quasi-static rollout: closed forms, its limit of the dynamic one, the pump's
balance, static loads."""

from types import SimpleNamespace

import mujoco
import numpy as np
import pytest
from arms import posed
from conftest import candidates
from made_logs import at_rest
from observation import trace
from scipy import signal

from hydroid.hydraulics.elementwise import ringing
from hydroid.hydraulics.oil import overshoot
from hydroid.hydraulics.records import JOINT, nominal_joints
from hydroid.hydraulics.valve import DENSITY, rod_speed
from hydroid.rungs import QUASI_STATIC, RUNGS
from hydroid.settings.hydraulics import HydraulicSettings
from hydroid.settings.problem import SimulationSettings
from hydroid.simulation import Simulation
from hydroid.simulation.quasi_static import turn
from hydroid.simulation.scenario import Scenario

SHOULDER, ROLL = 1, 3
"""a cylinder that lifts the arm, and a rotary actuator, 0-based"""
PUMP = {"pump_flow": 6e-5, "pump_droop": 60e5}


@pytest.fixture
def simulated(spec, arm):
    """Simulate constant commands [%] of some joints, 0-based; angles [rad] and what the
    actuators did."""

    def run(commands, seconds=2.0, model="quasi-static", period=0.01, **values):
        command = np.zeros((round(seconds / period) + 1, len(arm.joints)))
        for joint, value in commands.items():
            command[:, joint] = value
        log = at_rest(arm.pose("study"), command, period)
        one = candidates(arm, 1)
        one.mass[:], one.joints.stiffness[:] = arm.masses, 0.0
        for name, value in values.items():
            (one.mass if name == "mass" else one.joints[name])[:] = value
        stepping = RUNGS[model].stepping(1, 10)
        scenario = Scenario(
            spec, arm, log, sorted(commands), SimulationSettings(), stepping
        )
        return (
            Simulation(scenario).simulate(one).angle[0],
            trace(scenario, one),
            one.joints[0],
        )

    return run


def test_without_load_the_speed_is_opening_times_root_of_the_pressure(simulated):
    angle, trace, joints = simulated({ROLL: 40}, 1.0, damping=0.0)
    roll = joints[ROLL]
    share = trace.spool[-1, 0] / roll.slot_width_a
    half = (roll.supply_pressure - roll.tank_pressure) / 2  # both edges lose the same
    flow = roll.flow_coefficient * roll.opening_a * share * np.sqrt(2 * half / DENSITY)
    assert 0.1 < share < 0.9
    np.testing.assert_allclose(
        np.diff(angle[-20:, 0]) / 0.01, flow / roll.area_a, rtol=0.01
    )


@pytest.mark.parametrize(
    "commands", [{SHOULDER: 50}, {SHOULDER: -50}, {SHOULDER: 60, 2: -40}]
)
@pytest.mark.parametrize(
    "pump",
    [
        {},
        PUMP,
        PUMP | {"pump_limit": 8e5},
        PUMP | {"draw_a": 0.3, "draw_b": 0.8},
        PUMP | {"pump_exponent": 3.0},
        PUMP | {"pump_bypass": 0.8},
        {"compensation": 1.0},
        PUMP | {"compensation": 0.5},
    ],
)
def test_the_dynamic_model_converges_to_it_as_oil_stiffens_and_motion_slows(
    simulated, commands, pump
):
    def apart(slower, stiffer):
        each = {
            "opening_a": 3e-7 / slower,
            "opening_b": 3e-7 / slower,
            "leakage": 1e-14,
            "damping": 0.0,
        }
        each |= pump | (
            {"pump_flow": pump["pump_flow"] / slower} if "pump_flow" in pump else {}
        )
        each |= {"bulk_modulus": 8e8 * stiffer, "line_volume": 1e-6}
        models = "quasi-static", "dynamic"
        quasi, full = (
            simulated(commands, 1.0 * slower, model, **each)[0] for model in models
        )
        return np.abs(quasi - full).max() / np.ptp(full, axis=0).max()

    near, far = apart(4.0, 20.0), apart(1.0, 1.0)
    assert near < 0.01
    assert near < 0.5 * far


@pytest.mark.parametrize(("lag", "exponent"), [(0.0, 1.0), (0.02, 1.0), (0.02, 1.9)])
def test_what_comes_later_moves_the_joint_by_as_much_less(simulated, lag, exponent):
    each = {
        "plunger_mass": 0.008,
        "damping": 0.0,
        "dead_band_a": 25.0,
        "dead_band_b": 20.0,
    }
    for end in "ab":
        own = {"plunger_damping": 8.0, "pilot_lag": lag, "opening_exponent": exponent}
        each |= {f"{name}_{end}": value for name, value in own.items()}
    delays, to_and_fro = (
        0.1 + np.arange(0, 0.01, 0.0005),
        np.repeat([80.0, -60.0], [12, 13]),
    )
    ends = [
        simulated(
            {ROLL: to_and_fro}, 0.6, period=0.025, delay_a=delay, delay_b=delay, **each
        )[0][-2:, 0]
        for delay in delays  # over four sub-steps
    ]
    speed = np.ptp(ends[0]) / 0.025
    shifts = [(ends[0][-1] - angle[-1]) / speed for angle in ends]
    np.testing.assert_allclose(shifts, delays[0] - delays, atol=6e-5)


def test_what_a_short_pilot_lag_costs_is_in_proportion_to_it(simulated):
    own = {"plunger_mass": 0.008, "dead_band_a": 25.0, "plunger_damping_a": 8.0}
    lags = [0, 1e-8, 1e-6, 1e-4, 1e-3]
    ends = [
        simulated({ROLL: 80.0}, 0.6, pilot_lag_a=lag, **own)[0][-1, 0] for lag in lags
    ]
    lost = (ends[0] - np.array(ends[1:])) / lags[1:]
    np.testing.assert_allclose(lost, lost[-1], rtol=0.1)  # 6 % is left by the sub-steps


@pytest.mark.parametrize("model", ["quasi-static", "dynamic"])
@pytest.mark.parametrize("command", [50, -50])
def test_a_load_does_not_slow_a_compensated_valve(simulated, arm, model, command):
    stiff = {
        "bulk_modulus": 1.6e10,
        "leakage": 1e-14,
        "damping": 0.0,
        "opening_a": 1e-7,
        "opening_b": 1e-7,
    }

    def way(compensation, part):
        angle = simulated(
            {SHOULDER: command},
            2.0,
            model,
            **stiff,
            compensation=compensation,
            mass=part * arm.masses,
        )[0]
        return float(angle[-1, 0] - angle[0, 0])

    free, loaded = (way(1.0, part) for part in (0.4, 0.8))
    assert loaded == pytest.approx(free, rel=2e-3)
    assert abs(way(0.0, 0.8) / way(0.0, 0.4) - 1) > 0.02


def cylinder(**values):
    """A cylinder's COEFFICIENTS for `rod_speed`, with 1000 and 750 mm² [SI]."""
    a, b = (
        SimpleNamespace(area=area, return_=1.5, draw=1.0) for area in (1000e-6, 750e-6)
    )
    each = {"conductance": 0.7 * np.sqrt(2 / DENSITY), "tank_pressure": 5e5}
    each |= {"by_command": 0.0, "supply_pressure": 150e5}
    return SimpleNamespace(a=a, b=b, **each | values)


@pytest.mark.parametrize("opening", [4e-7, -4e-7])
@pytest.mark.parametrize("drag", [0.0, 2e4])
@pytest.mark.parametrize("limit", [np.inf, 1e-5, 2e-6])
@pytest.mark.parametrize("compensation", [0.0, 0.6, 1.0])
def test_speed_flow_and_pressures_are_continuous_in_the_load(
    opening, drag, limit, compensation
):
    """From a load beyond the supply to one that overruns what the pump gives."""
    c, supply = cylinder(flow_limit=limit, compensation=compensation), 150e5
    inner, outer = (c.a, c.b) if opening > 0 else (c.b, c.a)

    def under(load):
        """Speed, flow from the pump, pressures of the chamber that fills and of the
        other."""
        w = SimpleNamespace(
            open_area=opening,
            push=np.sign(opening) * load,
            thrust=200.0,
            drag=drag,
            faster=0.0,
        )
        speed, flow, _ = rod_speed(c, w, supply)
        leaving = (
            c.tank_pressure + (speed * outer.area / (c.conductance * 4e-7 * 1.5)) ** 2
        )
        entering = (leaving * outer.area + load + 200.0 + drag * speed) / inner.area
        return speed, flow, entering if speed > 0.0 else supply, leaving

    loads = np.linspace(1.6e4, -2e4, 4001)
    speed, flow, entering, leaving = np.array([under(load) for load in loads]).T
    assert speed[0] == 0.0
    assert np.all(np.diff(speed) >= 0.0)
    assert entering.min() > -1.0  # Pa: it cavitates instead
    assert entering.max() < supply + 1.0
    assert flow.max() <= limit * (1 + 1e-12)
    fed = entering > 1.0
    np.testing.assert_allclose(flow[fed], inner.area * speed[fed], rtol=1e-9)
    assert not fed[-1]
    for i, values in enumerate((speed, flow, entering, leaving)):
        steps = np.abs(np.diff(values))
        # a jump would stay as large between nearer loads; a root falls to 3 %
        k = int(steps.argmax())
        near = [under(load)[i] for load in np.linspace(loads[k], loads[k + 1], 1001)]
        assert np.abs(np.diff(near)).max() < 0.1 * steps[k] + 1e-9 * np.ptp(values)


@pytest.mark.parametrize("opening", [4e-7, -4e-7])
def test_by_command_the_speed_is_that_of_an_ideal_compensator_whatever_the_load(
    opening,
):
    def moved(by_command, load, supply=150e5, drag=0.0, thrust=0.0):
        limit = 1e-7 if by_command else np.inf
        c = cylinder(by_command=by_command, compensation=1.0, flow_limit=limit)
        w = SimpleNamespace(
            open_area=opening, push=load, thrust=thrust, drag=drag, faster=0.0
        )
        return rod_speed(c, w, supply)

    speed, flow, rise = moved(1.0, 0.0)
    free_speed, free_flow, _ = moved(0.0, 0.0)
    assert (speed, flow) == pytest.approx((free_speed, free_flow), rel=1e-12)
    assert rise == 0.0
    for load in (-1e6, -3e3, 3e3, 1e6):
        assert moved(1.0, load, 2e5, 1e5, 500.0) == (speed, flow, rise)


def test_by_command_a_joint_slows_the_others_and_is_not_slowed(simulated):
    """Also where it takes all that the pump gives, and more."""
    tilt = 2

    def ways(commands, flow):
        by_command = np.arange(7) == ROLL
        pump = PUMP | {"pump_flow": flow, "by_command": by_command}
        angle = simulated(commands, 1.0, damping=0.0, **pump)[0]
        return np.ptp(angle, axis=0)

    alone = ways({ROLL: 60}, 6e-5)[0]
    free = ways({tilt: 60}, 6e-5)[0]
    beside = [ways({tilt: 60, ROLL: 60}, flow) for flow in (6e-5, 3e-5, 1e-6)]
    for _, roll in beside:
        assert roll == pytest.approx(alone, rel=1e-12)
    slowed = [way / free for way, _ in beside]
    assert 1.0 > slowed[0] > slowed[1] > slowed[2]
    assert slowed[2] < 1e-3


@pytest.mark.parametrize("mass", [0.3, 1.0, 2.0])
@pytest.mark.parametrize("limit", [1e-6, 4e-6])
def test_both_models_agree_where_a_load_overruns_a_limited_flow(
    simulated, arm, mass, limit
):
    values = {
        "flow_limit": limit,
        "mass": mass * arm.masses,
        "return_a": 2.0,
        "opening_b": 2e-7,
    }
    values |= {"bulk_modulus": 1.6e10, "leakage": 1e-14, "damping": 0.0}
    (quasi, slow, joints), (full, fast, _) = (
        simulated({SHOULDER: -50}, 2.0, model, **values)
        for model in ("quasi-static", "dynamic")
    )
    speeds = [np.diff(angle[:, 0])[50:150].mean() for angle in (quasi, full)]
    assert speeds[0] < 0.0
    assert speeds[0] == pytest.approx(speeds[1], rel=0.01)
    assert slow.pressure[50:150].min() >= 0.0
    np.testing.assert_allclose(
        slow.pressure[100:150], fast.pressure[100:150], rtol=0.02, atol=1e5
    )
    taken = -slow.flow[100, 0, 1]
    # the load draws more than the pump gives, or as much
    assert taken >= limit * (1 - 1e-9)
    assert joints.area_b[SHOULDER] > 0


@pytest.mark.parametrize("exponent", [1.0, 3.0, 50.0])
@pytest.mark.parametrize("droop", [1e4, 60e5, 150e5])
@pytest.mark.parametrize("draw", [1.0, 0.6])
def test_what_the_actuators_take_is_what_the_pump_gives(
    simulated, draw, droop, exponent
):
    pump = {"pump_flow": 4e-5, "pump_droop": droop, "pump_exponent": exponent}
    _, trace, joints = simulated({SHOULDER: 70, 2: -60}, **pump, draw_a=draw)
    taken = np.where(
        trace.flow[..., 0] > 0, draw * trace.flow[..., 0], -trace.flow[..., 1]
    ).sum(axis=1)
    left = (joints.supply_pressure[SHOULDER] - trace.line[:, 0]) / droop
    given = pump["pump_flow"] * np.minimum(left, 1.0) ** (1.0 / exponent)
    moving = trace.line[:, 0] < joints.supply_pressure[SHOULDER]
    assert moving.sum() > 100
    np.testing.assert_allclose(taken[moving], given[moving], rtol=1e-6)


SMOOTH = {
    "a pump that holds its pressure up to a flow": {
        "pump_flow": 2e-5,
        "pump_droop": 150e5,
        "pump_exponent": 10.0,
    },
    "valves that open almost at once": {
        "opening_exponent_a": 0.18,
        "opening_exponent_b": 0.2,
        "pilot_lag_a": 0.07,
        "pilot_lag_b": 0.07,
        "opening_lag": 0.17,
    },
}


@pytest.mark.parametrize("values", SMOOTH.values(), ids=SMOOTH.keys())
def test_a_small_change_of_a_quantity_changes_the_motion_in_proportion(
    simulated, values
):
    """Else finite differences are no derivatives, and least squares finds no step."""
    rng = np.random.default_rng(5)
    levels = rng.choice([-70.0, 0.0, 60.0, 90.0], (3, 20))
    ramps = np.ones(5) / 5
    commands = {
        joint: np.convolve(np.repeat(level, 20), ramps)[:401]
        for joint, level in zip((SHOULDER, 2, ROLL), levels, strict=True)
    }

    def angle(change):
        dead = {f"dead_band_{end}": 20.0 * (1.0 + change) for end in "ab"}
        return simulated(commands, 4.0, plunger_mass=0.008, **dead, **values)[0]

    still = angle(0.0)
    assert (np.ptp(still, axis=0) > 0.02).all()
    changes = np.concatenate([k * np.logspace(-9, -6, 4) for k in (1, 2, 3, 5)])
    slopes = [(angle(change) - still) / change for change in changes]
    largest = np.abs(slopes[-1]).max()
    for slope in slopes:
        np.testing.assert_allclose(slope, slopes[-1], atol=1e-3 * largest)


@pytest.mark.parametrize("model", ["quasi-static", "dynamic"])
def test_the_pressure_falls_by_no_more_than_its_limit(simulated, model):
    """Up to there it is that without a limit, and below a pump that gives whatever is
    taken."""
    pump = PUMP | {"line_volume": 1e-6, "pump_limit": 8e5}
    _, limited, joints = simulated({SHOULDER: 70, 2: -60}, 1.0, model, **pump)
    _, without, _ = simulated(
        {SHOULDER: 70, 2: -60}, 1.0, model, **pump | {"pump_limit": np.inf}
    )
    low = joints.supply_pressure[SHOULDER] - pump["pump_limit"]
    assert without.line[:, 0].min() < low - 5e5
    assert limited.line[:, 0].min() == pytest.approx(low)
    beyond = np.flatnonzero(without.line[:, 0] < low)[0]
    np.testing.assert_allclose(limited.line[:beyond], without.line[:beyond])
    taken = np.where(
        limited.flow[..., 0] > 0, limited.flow[..., 0], -limited.flow[..., 1]
    ).sum(axis=1)
    given = PUMP["pump_flow"] * pump["pump_limit"] / PUMP["pump_droop"]
    assert taken.max() > 1.2 * given


@pytest.mark.parametrize("model", ["quasi-static", "dynamic"])
def test_what_is_not_drawn_from_the_pump_does_not_load_it(simulated, model):
    one, both = {SHOULDER: 70}, {SHOULDER: 70, 2: -60}
    constant = simulated(both, 1.0, model)[0]
    np.testing.assert_array_equal(simulated(both, 1.0, model, draw_a=0.3)[0], constant)
    weak = {"pump_flow": 8e-6, "line_volume": 1e-6}
    free = simulated(both, 1.0, model, **weak, draw_a=0.0, draw_b=0.0)[0]
    np.testing.assert_allclose(free, constant, atol=2e-3 * np.ptp(constant))
    full, less = (
        simulated(one, 1.0, model, **weak, draw_a=draw)[0] for draw in (1.0, 0.5)
    )
    # all that the pump gives
    assert np.ptp(less) == pytest.approx(2 * np.ptp(full), rel=0.05)


def test_pressures_carry_the_load_and_a_closed_valve_holds_it(simulated, arm, spec):
    angle, trace, _ = simulated({SHOULDER: 0})
    np.testing.assert_array_equal(angle, np.broadcast_to(angle[0], angle.shape))
    held = posed(spec.compile(), arm.pose("study")).qfrc_bias[SHOULDER]
    length, q = arm.joints[SHOULDER].actuator.length, arm.pose("study")[SHOULDER]
    lever = (length(q + 1e-4) - length(q - 1e-4)) / 2e-4
    assert trace.force[-1, 0] * lever == pytest.approx(held, rel=1e-3)


def test_a_load_beyond_the_supply_is_held_and_never_sinks(simulated):
    angle, _, _ = simulated({SHOULDER: 80}, supply_pressure=6e5)
    assert np.ptp(angle) == 0.0


@pytest.mark.parametrize("share", [0.0, 0.4, 1.0])
@pytest.mark.parametrize("ratio", [0.0, 0.3, 0.9])
def test_a_joint_rings_on_its_oil_as_the_exact_solution_whatever_the_step(ratio, share):
    """Start at rest under a constant velocity without oil: the known step response."""
    pace = 2 * np.pi * 1.7
    wanted = 0.6
    ends = []
    for steps in (1, 40):
        cosine, sine = ringing(np.array(1.7), np.array(ratio), 0.8 / steps)
        c = SimpleNamespace(
            oil_frequency=1.7,
            oil_damping=ratio,
            oil_damping_share=share,
            ring_cosine=cosine,
            ring_sine=sine,
        )
        z = SimpleNamespace(turning=0.0, surge=0.0)
        way = sum(overshoot(c, z, wanted) for _ in range(steps))
        ends.append((way, z.turning, z.surge))
    np.testing.assert_allclose(ends[0], ends[1], rtol=1e-9)
    drag = 2 * ratio * pace
    system = np.trim_zeros([share * drag, pace**2], "f"), [1, drag, pace**2]
    _, response = signal.step(system, T=[0, 0.8])
    assert ends[0][1] == pytest.approx(wanted * response[-1], rel=1e-9)
    way = np.polymul(system[1], [1, 0])
    _, response = signal.step((system[0], way), T=[0, 0.8])
    # what the joint is further on than at the wanted velocity
    assert ends[0][0] == pytest.approx(wanted * (response[-1] - 0.8), rel=1e-9)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_stop_takes_what_leads_into_it_and_leaves_what_leads_away(side):
    """Else a joint that just touches its stop would go on as another one that just does
    not."""
    cosine, sine = ringing(np.array(1.7), np.array(0.3), 0.02)
    c = SimpleNamespace(
        oil_frequency=1.7,
        oil_damping=0.3,
        oil_damping_share=0.0,
        ring_cosine=cosine,
        ring_sine=sine,
    )
    shut = SimpleNamespace(open_area=0.0, arm=1.0)
    states = []
    for room in (1e-9, -1e-9):
        # on the way to the stop, and turning back
        z = SimpleNamespace(angle=0.0, turning=side * 0.05, surge=-side * 5.0)
        free = SimpleNamespace(**vars(z))
        turn(c, free, shut, 1e7, (-np.inf, np.inf), 0.02)
        way = 0.02 * free.velocity
        limits = (-1.0, way + room) if side > 0 else (way - room, 1.0)
        _, after = turn(c, z, shut, 1e7, limits, 0.02)
        assert after == pytest.approx(way, abs=2e-9)
        states.append((z.turning, z.surge, free.turning, free.surge))
    assert (np.array(states)[:, 1] * side < 0.0).all()
    np.testing.assert_array_equal(states[0][:2], states[0][2:])
    assert states[1][1] == states[1][3]
    assert states[1][0] * side <= 0.0


def test_the_dynamic_model_rings_as_frequency_and_damping_ratio_say(
    simulated, arm, spec
):
    """A rotary actuator with soft oil: ω² = 2 β D²/(V M)."""
    soft = {"bulk_modulus": 2e6, "leakage": 1e-14, "damping": 0.0, "period": 0.005}
    angle, _, joints = simulated({ROLL: 50}, 0.8, "dynamic", **soft)
    model, inertia = spec.compile(), np.zeros((len(arm.joints),) * 2)
    mujoco.mj_fullM(model, posed(model, arm.pose("study")), inertia)
    roll = joints[ROLL]
    stiffness = 2 * roll.bulk_modulus * roll.area_a**2 / roll.dead_volume
    frequency = np.sqrt(stiffness / inertia[ROLL, ROLL]) / (2 * np.pi)
    rigid, rings = (
        simulated({ROLL: 50}, 0.8, **soft, oil_frequency=f, oil_damping=0.0)[0]
        for f in (np.inf, frequency)
    )
    assert np.abs(rings - angle).max() < 0.3 * np.abs(rigid - angle).max()


def test_valves_that_open_once_for_all_open_as_each_alone(spec, arm):
    """Of candidates that differ in one quantity each, none gets the opening of
    another's valve."""
    command = np.zeros((60, len(arm.joints)))
    command[5:30, [SHOULDER, ROLL]], command[30:, [SHOULDER, ROLL]] = (
        (70, -55),
        (-40, 80),
    )
    log = at_rest(arm.pose("study"), command, 0.02)
    names = [
        n
        for n in JOINT.names or ()
        if JOINT[n].kind == "f" and n not in ("sense", "stroke")
    ]
    everyone = candidates(arm, len(names))
    everyone.mass[:] = arm.masses
    everyone.joints[:] = nominal_joints(
        arm, HydraulicSettings(pump_flow=4.0, dead_band_a=10, dead_band_b=10)
    )
    for row, name in enumerate(names):
        value = everyone.joints[name][row]
        everyone.joints[name][row] = np.where(np.isfinite(value), 1.01 * value, value)
    stepping = QUASI_STATIC.stepping(1, 10)
    simulation = Simulation(
        Scenario(spec, arm, log, [SHOULDER, ROLL], SimulationSettings(), stepping)
    )
    together = simulation.simulate(everyone).angle
    alone = [
        simulation.simulate(everyone[row : row + 1]).angle[0]
        for row in range(len(names))
    ]
    np.testing.assert_array_equal(together, alone)
    assert len(np.unique(together[:, -1, 0])) > 25
