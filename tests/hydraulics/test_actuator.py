"""The laws of the whole actuator, on one joint under MuJoCo."""

from math import cos

import numpy as np
import pytest
from hydraulic_reference import (
    CENTRE,
    CYLINDER,
    DAMPING,
    GRAVITY,
    MASS,
    START,
    STIFFNESS,
    STROKE,
    TILT,
    A,
    B,
    parameters,
    pulses,
    simulate,
    wheel,
)

from hydroid.hydraulics.actuator import Observation
from hydroid.hydraulics.cylinder import triangle
from hydroid.hydraulics.records import BARS, LINKAGE, ROTARY
from hydroid.settings.hydraulics import HydraulicSettings

SETTINGS = HydraulicSettings()
TIGHT = HydraulicSettings(leakage=0.0)
Seen = list[tuple[Observation, np.ndarray]]


def cylinder(angle: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Travel and moment arm at angles of any shape."""
    return triangle(angle, A, B, float(CYLINDER.theta0[0]), float(CYLINDER.shortest[0]))[:2]


def weight(angle: float) -> float:
    """Torque of gravity and spring on the pendulum [N·m]."""
    return MASS * GRAVITY * CENTRE * cos(angle + TILT) + STIFFNESS * (angle - START)


def test_shut_chambers_keep_their_oil_through_any_motion_and_cavitation():
    """A wheel far too heavy for them swings on its spring; pressures are never below vapour pressure."""
    heavy = wheel(1e5)
    heavy.jnt_stiffness[:], heavy.qpos_spring[:] = 1e6, START
    seen: Seen = []
    angle = simulate(parameters(TIGHT), np.zeros(400), TIGHT, observe=seen, model=heavy, velocity=0.5)[0]
    pressure = np.array([o.pressure[0, 0] for o, _ in seen])
    assert np.ptp(angle) > 0.3
    assert pressure.min() == 0.0
    assert pressure.max() > 100e5
    # where it is back at an angle, so are the pressures: p + β ln V is the oil, which no motion changes
    volume = 30e-6 + 1e-3 * cylinder(angle[1:])[0]
    filled = pressure[:, 0] > 0
    oil = pressure[filled, 0] + 8e8 * np.log(volume[filled])
    np.testing.assert_allclose(oil, oil[0], rtol=1e-12)


def test_oil_volume_is_conserved_under_flow():
    """What flows in is swept volume plus compression: mass ρ V with ρ ~ exp(p/β) grows by ρ Q."""
    command = pulses(np.random.default_rng(4), 400)
    seen: Seen = []
    fine = HydraulicSettings(substeps=20)
    angle = simulate(parameters(fine), command, fine, observe=seen)[0]
    beta = 8e8
    for chamber, sign in ((0, 1.0), (1, -1.0)):
        travel = cylinder(angle)[0]
        volume = 30e-6 + (1e-3 * travel if chamber == 0 else 0.75e-3 * (STROKE - travel))
        pressure = np.array([o.pressure[0, 0, chamber] for o, _ in seen])
        flow = sign * np.array([o.flow[0, 0, chamber] for o, _ in seen])
        density = np.exp(pressure / beta)
        gained = density[-1] * volume[-1] - density[0] * volume[1]
        came = 0.01 * (density * flow)[1:].sum()
        assert abs(flow).sum() * 0.01 > 10e-6
        assert came == pytest.approx(gained, abs=3e-8)


@pytest.mark.parametrize("command", [70.0, -70.0])
def test_terminal_speed_is_flow_over_area(command: float):
    seen: Seen = []
    angle = simulate(parameters(SETTINGS), np.full(60, command), SETTINGS, observe=seen)[0]
    measured, velocity = seen[-1]
    rod_speed = cylinder(angle[-1])[1] * velocity[0, 0]
    chambers = measured.flow[0, 0] / np.array([1e-3, 0.75e-3])
    np.testing.assert_allclose(chambers, rod_speed, rtol=0.02)
    # and the flow is that of equations (7), (8) at the pressures seen
    opening = 0.4e-6 * abs(measured.spool[0, 0]) / 2e-3
    pa, pb = measured.pressure[0, 0]
    drops = (150e5 - pa, pb - 5e5) if command > 0 else (pa - 5e5, 150e5 - pb)
    wanted = np.sign(command) * 0.7 * opening * np.sqrt(2 * np.array(drops) / 860)
    np.testing.assert_allclose(measured.flow[0, 0], wanted, rtol=0.01)


def test_stiff_oil_is_the_incompressible_limit():
    """With β a thousandfold the joint starts at once, with the speed of its flow, without ringing."""
    seen: Seen = []
    p = parameters(SETTINGS, bulk_modulus=8e6)
    angle = simulate(p, np.full(100, 60.0), SETTINGS, observe=seen)[0]
    speed = np.array([v[0, 0] for _, v in seen])
    flow = np.array([o.flow[0, 0, 0] for o, _ in seen])
    rod_speed = cylinder(angle)[1][1:] * speed
    np.testing.assert_allclose(rod_speed[5:], flow[5:] / 1e-3, rtol=0.01)
    assert (np.diff(speed[10:]) > 0).all()  # the moment arm shrinks, the joint speeds up, nothing rings


def test_nothing_moves_in_the_dead_zone():
    p = parameters(TIGHT, overlap_a=1.0, overlap_b=1.0)
    still = simulate(p, np.full(300, 30.0), TIGHT)
    assert abs(still - START).max() < 1e-9
    moving = simulate(p, np.full(300, 90.0), TIGHT)
    assert moving[0, -1] > START + 0.01


def test_a_flow_limit_caps_speed():
    seen: Seen = []
    p = parameters(SETTINGS, flow_limit=0.6)
    simulate(p, np.full(80, 100.0), SETTINGS, observe=seen)
    flow = np.array([o.flow[0, 0, 0] for o, _ in seen])
    assert flow.max() <= 0.6e-3 / 60 * (1 + 1e-9)
    assert flow[-1] == pytest.approx(0.6e-3 / 60, rel=0.02)


def test_the_end_stop_obeys_equation_9_and_does_not_chatter():
    seen: Seen = []
    angle = simulate(parameters(SETTINGS), np.full(400, -100.0), SETTINGS, observe=seen)[0]
    travel, arm = cylinder(angle)
    touched = int(np.argmax(travel[1:] < 0))
    assert 0 < touched < 300
    assert (travel[1 + touched :] < 0).all()
    assert travel.min() > -5e-3
    speed = np.array([v[0, 0] for _, v in seen])
    assert (speed[touched + 5 :] < 0).all()
    for k in (touched + 20, -1):
        stop = 1e10 * travel[k + (k >= 0)] * arm[k + (k >= 0)] * speed[k]
        rest = (weight(angle[k + (k >= 0)]) + DAMPING * speed[k]) / arm[k + (k >= 0)]
        assert stop == pytest.approx(rest - seen[k][0].force[0, 0], rel=0.02)
        assert stop > 5e3


def test_rest_after_motion_is_rest():
    """No chatter: once the valve is shut and the arm has rung out, nothing moves but by leakage."""
    command = np.r_[np.full(100, 80.0), np.full(50, -60.0), np.zeros(850)]
    speed = np.diff(simulate(parameters(TIGHT), command, TIGHT)[0, -100:]) / 0.01
    assert abs(speed).max() < 1e-6


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


def test_dry_friction_takes_its_share_of_the_force():
    seen: Seen = []
    p = parameters(SETTINGS, dry_friction=2000.0)
    angle = simulate(p, np.full(80, 70.0), SETTINGS, observe=seen)[0]
    measured, velocity = seen[-1]
    arm = cylinder(angle[-1])[1]
    needed = (weight(angle[-1]) + DAMPING * velocity[0, 0]) / arm
    assert measured.force[0, 0] - needed == pytest.approx(2000.0, rel=0.05)


def test_a_rotary_actuator_turns_by_flow_over_displacement():
    linkage = np.array([(ROTARY, 0.0, 0.0, 0.0, *[0.0] * len(BARS))], LINKAGE).view(np.recarray)
    p = parameters(TIGHT, area_a=10.0, area_b=10.0, dead_volume=50.0, damping=5.0)
    seen: Seen = []
    command = np.repeat([60.0, 0.0], 100)
    angle = simulate(p, command, TIGHT, observe=seen, start=0.0, model=wheel(0.05), linkage=linkage)[0]
    assert angle[-1] > 1.0
    pressed = seen[-1][0].pressure[0, 0, 0] - 50e5
    flowed = 0.01 * sum(o.flow[0, 0, 0] for o, _ in seen)
    # swept volume plus compression of a chamber of constant volume, to the last digits
    assert flowed == pytest.approx(10e-6 * angle[-1] + 50e-6 * pressed / 8e8, rel=1e-9)
    assert abs(seen[-1][1]).max() < 1e-6
