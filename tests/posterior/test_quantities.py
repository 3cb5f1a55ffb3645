"""Quantities of an arm by laws: ratios, gravity, symmetry, the plant, analytic dead
bands, delays."""

from dataclasses import replace

import numpy as np
import pytest
from arms import posed, with_masses
from conftest import replaced
from made_logs import HYDRAULIC, TRUTH, step_log
from report_fits import make_problem, make_uncertainty

from hydroid import load_settings
from hydroid.hydraulics.records import Records
from hydroid.hydraulics.solenoid import coil_current, resting_stroke, side_voltage
from hydroid.identified_model import IdentifiedModel, identified
from hydroid.plant import Plant
from hydroid.posterior.bench import Bench, Movement, make_bench
from hydroid.posterior.quantities import (
    COMMANDS,
    actuator,
    joint_measure,
    quantities,
)
from hydroid.posterior.uncertainty import uncertainty_from
from hydroid.problem.bindings import Bindings
from hydroid.simulation import Candidates

TRUE = {name: value for name, value in HYDRAULIC.items() if name not in ("F1", "x1")}


def model(stage: str = "hyd", **changes: object) -> IdentifiedModel:
    springs = {"parameters.S.fixed": 0.0} if stage == "hyd" else {}
    settings = load_settings(f"article-{stage}", springs | changes)
    return identified(settings, TRUE if stage == "hyd" else TRUTH, "test")


def shoulder_bench(one: IdentifiedModel, joint: int = 2) -> tuple[Bench, Candidates]:
    log = step_log(one.settings.arm.pose("study"), {joint: [30.0, 50.0]})
    log.angle[-1, joint - 1] += 0.6  # the travel
    return make_bench(one.settings, [log], joint), Bindings(one.settings).candidates(
        one.theta[None]
    )


def measured(bench: Bench, estimate: Candidates) -> dict[str, list[float]]:
    """All quantities of one candidate by name; curves in the order of their points."""
    found: dict[str, list[float]] = {}
    values = joint_measure(bench, estimate)(estimate)
    for column, value in sorted(values, key=lambda pair: pair[0].at or 0.0):
        found.setdefault(f"joint{bench.joint}_{column.name}", []).append(
            float(value[0])
        )
    return found


@pytest.fixture(scope="module")
def shoulder() -> tuple[IdentifiedModel, Bench, Candidates, dict[str, list[float]]]:
    one = model()
    bench, estimate = shoulder_bench(one)
    return one, bench, estimate, measured(bench, estimate)


def test_gravity_torque_is_what_mujoco_needs_to_hold_the_whole_arm(shoulder):
    one, bench, estimate, found = shoulder
    arm = one.settings.arm
    pose = arm.pose("study")
    pose[1] = bench.angle
    held = posed(with_masses(arm, estimate.mass[0]), pose).qfrc_bias[1]
    assert found["joint2_gravity_torque_at_pose"] == [pytest.approx(held, rel=1e-6)]


def test_a_speed_is_that_of_the_plant_when_it_passes_the_pose(shoulder):
    one, bench, _, found = shoulder
    plant = Plant(one, joints=[2])
    for sign, name in ((1.0, "positive"), (-1.0, "negative")):
        pose = one.settings.arm.pose("study")
        pose[1] = bench.angle - sign * np.radians(8.0)
        plant.reset(pose)
        angle = [plant.step([0, sign * 50.0, 0, 0, 0, 0, 0])[1] for _ in range(200)]
        speed = sign * np.degrees(np.gradient(angle, 0.01))
        passes = np.interp(sign * bench.angle, sign * np.array(angle), speed)
        assert found[f"joint2_speed_50_{name}"] == [pytest.approx(passes, rel=0.02)]


def test_a_symmetric_actuator_without_gravity_moves_alike_both_ways():
    one = model(**{"hydraulics.onset_b": 1.4})
    # rotary: no moment arm that changes with the angle
    bench, estimate = shoulder_bench(one, joint=6)
    bench.scenario.arm.model.opt.gravity[:] = 0.0
    found = measured(bench, estimate)
    speed = np.array(found["joint6_speed"])
    np.testing.assert_allclose(speed, -speed[::-1], rtol=1e-6)
    assert found["joint6_dead_time_positive"] == pytest.approx(
        found["joint6_dead_time_negative"], rel=1e-6
    )


def spool(c: Records, command: float, onset: float) -> float:
    """Travel of a spool [m] under a command [%] without dead band."""
    current = coil_current(
        side_voltage(command, 1.0, onset), c.current_max[0], c.current_min[0]
    )
    currents = np.array([current, c.current_min[0]])
    moved, resting = resting_stroke(
        c.coil[0] * currents**2, c.gap[0], c.plunger_stiffness[0]
    )
    return float(moved - resting)


def test_the_dead_band_is_the_command_that_moves_the_spool_over_its_overlap():
    changes = {
        "hydraulics.overlap_a": 0.5,
        "hydraulics.overlap_b": 0.3,
        "hydraulics.leakage": 0.0,
    }
    bench, estimate = shoulder_bench(model(**changes))
    found, (c, *_) = measured(bench, estimate), actuator(bench, estimate)
    commands = np.linspace(1, 60, 1000)
    for sign, name, side in ((1.0, "positive", c.a), (-1.0, "negative", c.b)):
        opens = np.interp(
            side.overlap[0], [spool(c, u, side.onset[0]) for u in commands], commands
        )
        (band,) = found[f"joint2_dead_band_{name}"]
        assert band == pytest.approx(opens, abs=0.01)
        load = bench.loads(estimate)
        (still, moves) = bench.steady(
            estimate, sign * np.array([band - 0.01, band + 0.01]), load
        )[0]
        assert still == 0.0
        assert moves != 0.0


@pytest.mark.parametrize("quasi_static", [False, True])
def test_a_dead_band_that_is_a_parameter_is_no_quantity_beside_it(quasi_static: bool):
    """The voltage at the smallest command opens the valve at once: only the parameter
    says where."""
    changes = {
        "hydraulics.dead_band_a": 24.7,
        "hydraulics.dead_band_b": 31.0,
        "hydraulics.leakage": 0.0,
    }
    changes |= {"simulation.model": "quasi-static"} if quasi_static else {}
    bench, estimate = shoulder_bench(model(**changes))
    assert not [name for name in measured(bench, estimate) if "dead_band" in name]
    load = bench.loads(estimate)
    speeds = bench.steady(estimate, np.array([24.6, 24.8, -30.9, -31.1]), load)[0]
    assert (speeds != 0.0).tolist() == [False, True, False, True]


def test_what_a_joint_does_that_its_command_does_not_move_is_not_stated():
    changes = {
        "hydraulics.dead_band_a": 60.0,
        "hydraulics.dead_band_b": 45.0,
        "hydraulics.leakage": 0.0,
    }
    found = measured(*shoulder_bench(model(**changes)))
    stated = {name for name in found if name.endswith(("positive", "negative"))}
    assert "joint2_speed_50_positive" not in stated
    assert {
        "joint2_speed_100_positive",
        "joint2_speed_50_negative",
        "joint2_gain_negative",
    } <= stated
    # of the curve, whose points up to 100 % come last
    speed = dict(zip(COMMANDS, found["joint2_speed"][-len(COMMANDS) :], strict=True))
    assert speed[50.0] == 0.0
    # a gain leaves out the dead band
    slope = abs(speed[90.0] - speed[70.0]) / 20.0
    assert found["joint2_gain_positive"] == [pytest.approx(slope)]


def test_a_dead_band_and_an_overlap_add_up_to_one():
    both = {"hydraulics.dead_band_a": 20.0, "hydraulics.overlap_a": 0.5}
    bench, estimate = shoulder_bench(model(**both))
    found, (c, *_) = measured(bench, estimate), actuator(bench, estimate)
    assert "joint2_dead_band_negative" not in found
    commands = np.linspace(1, 100, 1000)
    travels = [spool(c, u, c.a.onset[0]) for u in commands]
    # of a pilot stage without dead band
    beyond = np.interp(c.a.overlap[0], travels, commands)
    assert found["joint2_dead_band_positive"] == [
        pytest.approx(20.0 + beyond * (100 - 20) / 100, abs=0.01)
    ]


def test_commands_that_are_on_or_off_tell_nothing_of_what_lies_between():
    one = model()
    log = step_log(one.settings.arm.pose("study"), {2: [100.0, 0.0, -30.0, 0.0, -60.0]})
    log.angle[-1, 1] += 0.6
    bench = make_bench(one.settings, [log], 2)
    estimate = Bindings(one.settings).candidates(one.theta[None])
    found = measured(bench, estimate)
    columns = [column for column, _ in joint_measure(bench, estimate)(estimate)]
    points = [column.at or 0.0 for column in columns if column.name == "speed"]
    assert [point for point in points if point > 0] == [100.0]
    assert len([point for point in points if point < 0]) == 11
    assert {
        "joint2_speed_50_negative",
        "joint2_gain_negative",
        "joint2_speed_100_positive",
    } <= set(found)
    assert not {"joint2_speed_50_positive", "joint2_gain_positive"} & set(found)


@pytest.mark.parametrize("model_name", ["dynamic", "quasi-static"])
def test_a_speed_is_that_of_the_settled_motion_of_a_joint_that_rings(model_name: str):
    """On its oil it rings at 1 Hz, and yields to the load that changes on the way."""
    soft = {
        "simulation.model": model_name,
        "hydraulics.leakage": 0.0,
        "hydraulics.bulk_modulus": 110.0,
    }
    soft |= {
        "parameters.D.fixed": 40.0,
        "hydraulics.oil_frequency": 0.9,
        "hydraulics.oil_damping": 0.2,
    }
    one = model(**soft)
    bench, estimate = shoulder_bench(one)
    found, plant = measured(bench, estimate)["joint2_speed"], Plant(one, joints=[2])
    at_10 = found[12]
    pose = one.settings.arm.pose("study")
    pose[1] = bench.angle - np.radians(24.0)
    plant.reset(pose)
    angle = np.array([plant.step([0, 10.0, 0, 0, 0, 0, 0])[1] for _ in range(600)])
    speed = np.degrees(np.gradient(angle, 0.01))
    passes = int(np.argmax(angle >= bench.angle))
    assert passes > 330
    # two oscillations, which are nearly over
    around = slice(passes - 100, passes + 100)
    settled = np.polyfit(angle[around] - bench.angle, speed[around], 1)[1]
    assert settled == pytest.approx(at_10, rel=0.015)
    assert np.abs(speed[60:160] - settled).max() > 0.2 * settled


def test_a_transport_delay_adds_to_the_dead_time_and_to_nothing_else(shoulder):
    found = measured(*shoulder_bench(model(**{"hydraulics.delay": 0.1})))
    for name in ("joint2_dead_time_positive", "joint2_dead_time_negative"):
        assert found[name][0] - shoulder[3][name][0] == pytest.approx(0.1, abs=2e-3)
    for name in ("joint2_time_constant_positive", "joint2_speed_50_positive"):
        assert found[name] == pytest.approx(shoulder[3][name], rel=0.02)


def test_the_natural_frequency_is_that_of_the_oscillation_after_a_step(shoulder):
    _, bench, estimate, found = shoulder
    angle = Movement(bench, 5.0, 60).angles(estimate)[0]
    speed = np.diff(angle) - np.linspace(0, 1, 60) * (angle[-1] - angle[-2])
    peaks = np.flatnonzero((speed[1:-1] > speed[:-2]) & (speed[1:-1] > speed[2:]))[:3]
    assert 1 / (np.diff(peaks).mean() * 0.01) == pytest.approx(
        found["joint2_natural_frequency"][0], rel=0.15
    )


def test_stage_1s_quantities_are_its_ratios():
    bench, estimate = shoulder_bench(model("mech"))
    found = measured(bench, estimate)
    gain = np.degrees(0.2 / 231.8)
    assert found["joint2_gain"] == [pytest.approx(gain)]
    commands = np.array([-100, -75, -50, -25, -10, 10, 25, 50, 75, 100])
    np.testing.assert_allclose(found["joint2_speed"], gain * commands)
    scaled = replaced(
        estimate, gain=3 * estimate.joints.gain, damping=3 * estimate.joints.damping
    )
    assert measured(bench, scaled)["joint2_gain"] == [pytest.approx(gain)]


def test_quantities_are_smooth_in_the_parameters(shoulder):
    one, bench, estimate, _ = shoulder
    measure = joint_measure(bench, estimate)
    step = np.zeros_like(one.theta)
    step[one.settings.parameter_set().names.index("A_A")] = 1e-3
    rows = one.theta * (1 + np.outer([-10, -1, 0, 1, 10], step))
    for column, value in measure(Bindings(one.settings).candidates(rows)):
        near, far = (value[3] - value[1]) / 2, (value[4] - value[0]) / 20
        assert near == pytest.approx(far, rel=0.2, abs=2e-5 * (abs(value[2]) + 1)), (
            column.label
        )


def test_a_quantity_is_known_from_the_logs_or_from_the_priors_as_its_parameters_are():
    problem = make_problem(outputs=(2,), samples=200)
    middle = (problem.parameters.lower + problem.parameters.upper) / 2
    from_logs = make_uncertainty(problem, middle)
    known, _ = quantities(problem, from_logs)
    assert known
    for quantity in known.values():
        assert quantity.data_share == pytest.approx(1.0, abs=0.01)
    # the logs say next to nothing, and each parameter has a prior of 20 %
    linear = replace(
        from_logs.linear,
        slopes=1e-6 * from_logs.linear.slopes,
        prior_slopes=5.0 * np.eye(len(from_logs.linear.slopes)),
    )
    expected, _ = quantities(problem, uncertainty_from(from_logs.likelihood, linear))
    assert expected.keys() == known.keys()
    for quantity in expected.values():
        assert quantity.data_share == pytest.approx(0.0, abs=0.01)
