"""The laws of the components, each used alone on plain arrays."""

from types import SimpleNamespace

import numpy as np
import pytest

from hydroid.hydraulics.cylinder import holding_pressures, stop_damping
from hydroid.hydraulics.elementwise import kept
from hydroid.hydraulics.records import has_force_curve, nominal_joints
from hydroid.hydraulics.solenoid import (
    beyond_dead_band,
    coil_force,
    curve_exists,
    force_curve,
    plunger_step,
    plunger_weight,
    resting_stroke,
    side_voltage,
)
from hydroid.hydraulics.valve import KNOTS, curved, port_flow
from hydroid.settings.arm import Arm
from hydroid.settings.hydraulics import HydraulicSettings

ARTICLE = (8.0, 0.7, 0.8e-3, 12e-3, 0.9)


def plunger(gap: float, mass: float = 0.05) -> SimpleNamespace:
    return SimpleNamespace(gap=gap, plunger_mass=mass, plunger_stiffness=2000.0)


def test_nothing_passes_the_dead_band_and_the_full_command_stays_full():
    commands = (-50.0, 39.9, 40.0, 40.0 + 1e-9, 70.0, 100.0)
    passed = np.array([beyond_dead_band(u, u, 0.0, 0.0, 40.0) for u in commands])
    np.testing.assert_allclose(
        side_voltage(*passed.T, 1.4, 40.0), [0, 0, 0, 1.4, 5.7, 10], atol=1e-9
    )


@pytest.mark.parametrize("start", [-80.0, 0.0, 25.0, 60.0])
@pytest.mark.parametrize("asked", [-60.0, 30.0, 40.0, 50.0])
def test_what_a_lag_passes_beyond_the_dead_band_is_its_mean_over_the_step(
    start: float, asked: float
):
    for steps in (0.05, 0.7, 4.0):
        keep = float(kept(steps))
        stage = asked + (start - asked) * np.exp(
            -(np.arange(100_000) + 0.5) / 100_000 / steps
        )
        beyond, part = beyond_dead_band(start, asked, steps, keep, 40.0)
        assert beyond == pytest.approx(np.maximum(stage - 40.0, 0.0).mean(), abs=1e-3)
        assert part == pytest.approx(np.mean(stage > 40.0), abs=1e-4)
    assert beyond_dead_band(start, 40.0, 0.0, 0.0, 40.0) == (0.0, 0.0)


@pytest.mark.parametrize(
    "broken", [(0.5, 0.7, 0.8, 12), (8, 0.7, 12, 0.8), (8, 0.7, 5, 12), (8, 0.7, 0, 12)]
)
def test_impossible_curves_are_marked_and_have_no_force(
    broken: tuple[float, float, float, float],
):
    assert not curve_exists(*broken)
    coil, gap = force_curve(*broken, 0.9)
    assert coil == 0.0
    assert gap > 0.0


def test_plunger_rests_where_spring_and_coil_balance():
    rng = np.random.default_rng(0)
    drive, gap = 10 ** rng.uniform(-9, -3, 500), 10 ** rng.uniform(-6, -2, 500)
    stroke = resting_stroke(drive, gap, 2000.0)
    np.testing.assert_allclose(
        coil_force(drive, stroke, gap), 2000.0 * stroke, rtol=1e-9
    )
    assert resting_stroke(0.0, 1e-3, 2000.0) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("mass", [0.05, 1e-4])
def test_plunger_settles_at_rest_without_ringing_on(mass: float):
    coil, gap = force_curve(*ARTICLE)
    rest = resting_stroke(coil * 0.36, gap, 2000.0)
    motion = np.array(0.0), np.array(0.0)
    c = plunger(gap, mass)
    weight = plunger_weight(20.0, 2.5e-3, c)
    for _ in range(80):
        motion = plunger_step(motion, coil * 0.36, 20.0, 2.5e-3, weight, c)
    stroke, speed = motion
    assert stroke == pytest.approx(rest, rel=1e-6)
    assert speed == pytest.approx(0.0, abs=1e-8)


def test_plunger_converges_at_second_order():
    coil, gap = force_curve(*ARTICLE)

    def end(steps: int) -> float:
        motion, step = (5e-4, 0.0), 0.01 / steps
        weight = plunger_weight(20.0, step, plunger(gap))
        for _ in range(steps):
            motion = plunger_step(motion, coil * 0.81, 20.0, step, weight, plunger(gap))
        return float(motion[0])

    exact = end(4000)
    assert abs(end(10) - exact) / abs(end(20) - exact) == pytest.approx(4.0, rel=0.2)


def test_a_curve_changes_the_power_laws_increments_between_its_knots():
    def side(*factors: float) -> SimpleNamespace:
        named = {f"curve_{k}": factor for k, factor in enumerate(factors, start=1)}
        return SimpleNamespace(
            **named, **{f"knot_{k}": knot**1.6 for k, knot in enumerate(KNOTS, start=1)}
        )

    travel = np.linspace(0.0, 1.0, 1001)
    power = travel**1.6
    assert np.array_equal(curved(power, side(1.0, 1.0, 1.0, 1.0)), power)
    factors = 50.0, 0.3, 2.0, 0.5
    opening = curved(power, side(*factors))
    assert opening[[0, -1]] == pytest.approx([0.0, 1.0])
    assert (np.diff(opening) > 0).all()
    ends = np.array([0.0, *KNOTS, 1.0])
    steps = np.diff(np.interp(ends, travel, opening)) / np.diff(ends**1.6)
    np.testing.assert_allclose(steps[:-1] / steps[-1], factors)


@pytest.mark.parametrize("compensation", [0.0, 0.4, 1.0])
@pytest.mark.parametrize("pressure", [20e5, 100e5, 130e5, 170e5])
def test_the_flow_into_a_chamber_has_the_slopes_that_it_states(
    compensation: float, pressure: float
):
    c = SimpleNamespace(
        transition_pressure=0.2e5, conductance=0.03, flow_limit=np.inf, backflow=-np.inf, tank_pressure=5e5,
        anticavitation=0.0, compensation=compensation,
    )  # fmt: skip

    def flow(pressure: float, supply: float) -> np.ndarray:
        return np.array(port_flow(pressure, supply, 2e-6, 1e-6, c))

    _, fall, pumped, give = flow(pressure, 150e5)
    steeper = (flow(pressure + 1e3, 150e5) - flow(pressure - 1e3, 150e5)) / 2e3
    assert -steeper[0] == pytest.approx(fall, rel=1e-5)
    stronger = (flow(pressure, 150e5 + 1e3) - flow(pressure, 150e5 - 1e3)) / 2e3
    assert stronger[2] == pytest.approx(give, rel=1e-5)
    if compensation == 1.0 and pressure < 0.75 * 150e5:
        assert pumped == pytest.approx(0.03 * 2e-6 * np.sqrt(0.25 * 150e5), rel=1e-4)


def test_stops_oppose_motion_into_them_only():
    motions = (-1e-3, -0.1), (-1e-3, 0.1), (0.05, 1.0), (0.136, 0.1), (0.136, -0.1)
    damping = [stop_damping(travel, speed, 0.135, 1e10) for travel, speed in motions]
    np.testing.assert_allclose(damping, [1e7, 0, 0, 1e7, 0], rtol=1e-9)


def test_holding_pressures_balance_and_stay_between_tank_and_supply_where_they_can():
    rng = np.random.default_rng(0)
    force = rng.uniform(-2e4, 2e4, 2000)
    a, b = rng.uniform(2e-4, 2.5e-3, 2000), rng.uniform(2e-4, 2e-3, 2000)
    pa, pb = holding_pressures(force, a, b, 150e5, 5e5, 50e5)
    np.testing.assert_allclose(a * pa - b * pb, force, atol=1e-6)
    possible = (force <= a * 150e5 - b * 5e5) & (force >= a * 5e5 - b * 150e5)
    inside = (pa > 5e5 - 1) & (pa < 150e5 + 1) & (pb > 5e5 - 1) & (pb < 150e5 + 1)
    assert (inside == possible).all()
    assert 0.1 < possible.mean() < 0.95
    kept = possible & (pb == 50e5)
    assert kept.any()
    assert min(pa.min(), pb.min()) > 5e5 - 1


def test_nominal_joints_are_the_settings_in_si(arm: Arm):
    p = nominal_joints(arm, HydraulicSettings())[None].view(np.recarray)
    np.testing.assert_allclose(p.area_a[0, 1], 1000e-6)
    np.testing.assert_allclose(p.area_b[0, 3], 10e-6)
    np.testing.assert_allclose(p.dead_volume[0, [1, 3]], [30e-6, 50e-6])
    assert np.isinf(p.flow_limit).all()
    assert has_force_curve(p).all()
    np.testing.assert_allclose(p.onset_b, 1.2)
    assert not any(
        p[name].any() for name in ("gain", "damping", "stiffness", "friction")
    )
