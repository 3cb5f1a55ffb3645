"""The laws of the whole actuator, on one joint under MuJoCo."""

from math import cos

import numpy as np
import pytest
from hydraulic_reference import (
    CENTRE,
    DAMPING,
    GRAVITY,
    MASS,
    START,
    STIFFNESS,
    STROKE,
    TILT,
    cylinder,
    parameters,
    pulses,
    rotary,
    simulate,
    watched,
    wheel,
)

from hydroid.hydraulics.solenoid import force_curve
from hydroid.settings.hydraulics import HydraulicSettings

SETTINGS = HydraulicSettings()
TIGHT = HydraulicSettings(leakage=0.0)


def weight(angle: float) -> float:
    return MASS * GRAVITY * CENTRE * cos(angle + TILT) + STIFFNESS * (angle - START)


def test_shut_chambers_keep_their_oil_through_any_motion_and_cavitation():
    """A wheel far too heavy for them swings on its spring; pressures are never below
    vapour pressure."""
    heavy = wheel(1e5)
    heavy.jnt_stiffness[:], heavy.qpos_spring[:] = 1e6, START
    angle, seen, _ = watched(
        parameters(TIGHT), np.zeros(400), TIGHT, model=heavy, velocity=0.5
    )
    pressure = seen.pressure
    assert np.ptp(angle) > 0.3
    assert pressure.min() == 0.0
    assert pressure.max() > 100e5
    # where it is back at an angle, so are the pressures: p + β ln V is the oil, which
    # no motion changes
    volume = 30e-6 + 1e-3 * cylinder(angle[1:])[0]
    filled = pressure[:, 0] > 0
    oil = pressure[filled, 0] + 8e8 * np.log(volume[filled])
    np.testing.assert_allclose(oil, oil[0], rtol=1e-12)


def test_oil_volume_is_conserved_under_flow():
    """What flows in is swept volume plus compression: mass ρ V with ρ ~ exp(p/β) grows
    by ρ Q."""
    command = pulses(np.random.default_rng(4), 400)
    fine = HydraulicSettings(substeps=20)
    angle, seen, _ = watched(parameters(fine), command, fine)
    beta = 8e8
    for chamber, sign in ((0, 1.0), (1, -1.0)):
        travel = cylinder(angle)[0]
        volume = 30e-6 + (
            1e-3 * travel if chamber == 0 else 0.75e-3 * (STROKE - travel)
        )
        pressure, flow = seen.pressure[:, chamber], sign * seen.flow[:, chamber]
        density = np.exp(pressure / beta)
        gained = density[-1] * volume[-1] - density[0] * volume[1]
        came = 0.01 * (density * flow)[1:].sum()
        assert abs(flow).sum() * 0.01 > 10e-6
        assert came == pytest.approx(gained, abs=3e-8)


def test_a_flow_limit_caps_speed():
    flow = watched(parameters(SETTINGS, flow_limit=0.6), np.full(80, 100.0), SETTINGS)[
        1
    ].flow[:, 0]
    assert flow.max() <= 0.6e-3 / 60 * (1 + 1e-9)
    assert flow[-1] == pytest.approx(0.6e-3 / 60, rel=0.02)


def test_the_end_stop_obeys_equation_9_and_does_not_chatter():
    angle, seen, speed = watched(parameters(SETTINGS), np.full(400, -100.0), SETTINGS)
    travel, arm = cylinder(angle)
    touched = int(np.argmax(travel[1:] < 0))
    assert 0 < touched < 300
    assert (travel[1 + touched :] < 0).all()
    assert travel.min() > -5e-3
    assert (speed[touched + 5 :] < 0).all()
    for k in (touched + 20, -1):
        stop = 1e10 * travel[k + (k >= 0)] * arm[k + (k >= 0)] * speed[k]
        rest = (weight(angle[k + (k >= 0)]) + DAMPING * speed[k]) / arm[k + (k >= 0)]
        assert stop == pytest.approx(rest - seen.force[k], rel=0.02)
        assert stop > 5e3


def test_a_load_sinks_on_the_oil_that_leaves():
    """With a wide A→T edge the pump cannot fill B: a check valve does, and only A
    carries the load."""
    ends, fine = [], HydraulicSettings(substeps=10)
    for edges in ({}, {"return_a": 6.0, "anticavitation": 5.0}, {"return_a": 6.0}):
        ends.append(watched(parameters(fine, **edges), np.full(60, -50.0), fine)[1])
    alike, filled, starved = (1e-5 * end.pressure[-1] for end in ends)
    assert alike.min() > 30  # equal edges press both chambers
    assert 0 < filled[1] < 5.0  # below the tank's pressure, and no vapour
    assert filled[0] < alike[0]
    assert (ends[1].flow[-1] < 0).all()
    assert starved[1] == 0.0


COIL, GAP = force_curve(8.0, 0.7, 0.8, 12.0, 0.9)
SCALE = np.array([1.0, 1.3])
NULL = {
    "other points of the same force-stroke curve": {
        "force_1": COIL * 0.81 / (np.array([0.8, 1.7]) + GAP) ** 2, "stroke_1": [0.8, 1.7],
        "force_2": COIL * 0.81 / (np.array([12.0, 9.0]) + GAP) ** 2, "stroke_2": [12.0, 9.0],
    },
    "currents against forces": {
        "current_max": 0.9 * SCALE, "current_min": 0.3 * SCALE,
        "force_1": 8 / SCALE**2, "force_2": 0.7 / SCALE**2,
    },
}  # fmt: skip
"""two points along each null direction of the solenoids"""


@pytest.mark.parametrize("name", NULL)
def test_a_null_direction_gives_the_same_motion(name: str):
    angle = simulate(
        parameters(SETTINGS, **NULL[name]),
        pulses(np.random.default_rng(5), 300),
        SETTINGS,
    )
    np.testing.assert_allclose(angle[1], angle[0], atol=1e-11)
    assert np.ptp(angle[0]) > 0.05


def test_delay_shifts_the_response():
    fine = HydraulicSettings(leakage=0.0, substeps=10)
    command = pulses(np.random.default_rng(7), 300)
    p = parameters(fine, delay=np.array([0.0, 0.05, 0.0499999, 0.0525]))
    prompt, late, near, between = simulate(p, command, fine)
    np.testing.assert_allclose(late[5:], prompt[:-5], atol=1e-9)
    assert np.ptp(prompt) > 0.05
    assert abs(near - late).max() < 1e-5  # continuous through a whole number of samples
    # part of a sample: against steps of 2.5 ms, of which the delay is a whole number
    exact = simulate(p[3:].view(np.recarray), command, fine, steps=4)[0]
    assert abs(between - exact).max() < 0.1 * abs(late - exact).max()


def test_a_rotary_actuator_turns_by_flow_over_displacement():
    p = rotary(
        parameters(TIGHT, area_a=10.0, area_b=10.0, dead_volume=50.0, damping=5.0)
    )
    command = np.repeat([60.0, 0.0], 100)
    angle, seen, speed = watched(p, command, TIGHT, start=0.0, model=wheel(0.05))
    assert angle[-1] > 1.0
    pressed, flowed = seen.pressure[-1, 0] - 50e5, 0.01 * seen.flow[:, 0].sum()
    # swept volume plus compression of a chamber of constant volume, to the last digits
    assert flowed == pytest.approx(10e-6 * angle[-1] + 50e-6 * pressed / 8e8, rel=1e-9)
    assert abs(speed[-1]) < 1e-6
