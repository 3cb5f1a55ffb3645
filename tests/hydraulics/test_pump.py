"""One pump for all actuators: limits, power, how it comes up, a stiff reference."""

import numpy as np
import pytest
from hydraulic_arm import DrivenArm, nominal
from hydraulic_reference import changed, parameters, pulses, simulate

from hydroid.settings.arm import Arm
from hydroid.settings.hydraulics import HydraulicSettings

SETTINGS = HydraulicSettings(substeps=10)
LITRES = 6e4


def observe(
    arm: Arm, command: list[float], samples: int, **pump: float
) -> tuple[np.ndarray, ...]:
    """The arm, commands constant: line [bar], (T,), inflow [L/min], (T, J), chambers
    [bar], (T, J, 2)."""
    joints = changed(nominal(arm, SETTINGS), leakage=0.0, **pump)
    seen = DrivenArm(arm, joints, np.tile(command, (samples, 1)), SETTINGS).trace()
    into = np.where(np.array(command) > 0, seen.flow[1:, :, 0], -seen.flow[1:, :, 1])
    return 1e-5 * seen.line[1:, 0], LITRES * into, 1e-5 * seen.pressure[1:]


def test_a_pump_that_suffices_changes_nothing():
    command = 0.4 * pulses(np.random.default_rng(3), 300)
    both, seen = parameters(SETTINGS, pump_flow=np.array([np.inf, 500.0])), []
    angle = simulate(both, command, SETTINGS, observe=seen)
    assert np.ptp(angle[0]) > 0.1
    # above it, the check valve changes something
    assert max(o.pressure.max() for o, _ in seen) < 150e5
    np.testing.assert_allclose(angle[1], angle[0], atol=1e-9)


@pytest.mark.parametrize(("droop", "draw"), [(0.0, 1.0), (60.0, 1.0), (60.0, 0.4)])
def test_joints_that_move_together_share_the_flow(arm: Arm, droop: float, draw: float):
    command = [0.0, 70.0, 0.0, -90.0, 0.0, 60.0, 0.0]
    alone = [
        observe(arm, [u if j == k else 0.0 for k, u in enumerate(command)], 60)[1]
        for j in (1, 3, 5)
    ]
    wanted = sum(flow[-1].sum() for flow in alone)
    most = 0.6 * draw * wanted
    pump = {"pump_flow": most, "pump_droop": droop, "draw_a": draw, "draw_b": draw}
    line, flow, pressure = observe(arm, command, 60, line_volume=5.0, **pump)
    taken = draw * flow
    given = most * min(1.0, (150.0 - line[-1]) / droop) if droop else most
    assert taken[-5:].sum(axis=1).mean() == pytest.approx(given, rel=0.02)
    stored = 5e-3 * (150.0 - line[-1]) / 8000.0  # oil that the line gave [L]
    assert taken.sum(axis=1).mean() * 0.01 <= most / 60 * 0.6 + stored
    assert (flow[-1, [1, 3, 5]] > 0).all()
    assert line[-1] < 140
    # no oil runs back: each feeding chamber is below the line where oil flows
    feeding = np.array([pressure[-1, 1, 0], pressure[-1, 3, 1], pressure[-1, 5, 0]])
    assert (feeding < line[-1]).all()


def test_the_valves_lose_power_and_never_make_any(arm: Arm):
    """Pump and tank give at least what the chambers get, at every step once the start
    has passed."""
    command = [0.0, 70.0, 50.0, -90.0, 0.0, 60.0, 0.0]
    line, flow, pressure = observe(arm, command, 100, pump_flow=4.0)
    driven = [1, 2, 3, 5]
    feeding = np.where(np.array(command) > 0, pressure[:, :, 0], pressure[:, :, 1])[
        :, driven
    ]
    lost = flow[:, driven] * (line[:, None] - feeding)
    assert lost.sum(axis=1)[5:].min() >= 0
    assert lost.min() > -1.0  # L/min bar: 1.7 mW
    assert line.max() <= 150.0


def test_no_load_sinks_while_another_joint_takes_the_pressure(arm: Arm):
    """Load check valves: an open valve below its load's pressure passes nothing."""
    heavy, light = [0.0, 15.0, 0, 0, 0, 0, 0], [0.0, 15.0, 0, 0, 0, 0, -100.0]
    line, flow, pressure = observe(arm, light, 40, pump_flow=0.05, line_volume=5.0)
    assert (line[20:] < pressure[20:, 1, 0]).all()
    assert flow[:, 1].min() >= -1e-6
    assert observe(arm, heavy, 40, pump_flow=0.05, line_volume=5.0)[1][-1, 1] > 0


@pytest.mark.parametrize(("delay", "rise"), [(0.5, 0.0), (0.0, 0.3), (0.4, 0.2)])
def test_a_pump_comes_up_after_the_demand(arm: Arm, delay: float, rise: float):
    command = [0.0, -60.0, 0.0, 0.0, 0.0, 0.0, 0.0]
    pump = {
        "pump_flow": 0.5,
        "pump_idle": 0.4,
        "pump_delay": delay,
        "pump_rise": rise,
        "line_volume": 5.0,
    }
    flow = observe(arm, command, 150, **pump)[1][:, 1]
    time = 0.01 * np.arange(150) + 0.005
    since = np.maximum(time - delay, 0.0)
    share = 0.4 + 0.6 * ((since > 0) if rise == 0 else 1 - np.exp(-since / rise))
    later = (time > 0.15) & (abs(time - delay) > 0.1)
    np.testing.assert_allclose(flow[later], 0.5 * share[later], rtol=0.03)


def test_at_rest_the_pump_stands_by_again():
    """After the last command φ falls with the same time constant, and the delay counts
    from the next one."""
    command = np.repeat([100.0, 0.0, 100.0], 100)
    values = {
        "pump_flow": 0.5,
        "pump_idle": 0.3,
        "pump_delay": 0.5,
        "pump_rise": 0.01,
        "line_volume": 5.0,
    }
    angle = simulate(parameters(SETTINGS, **values), command, SETTINGS)[0]
    speed = np.diff(angle) / 0.01
    slow, fast, again = speed[20:45].mean(), speed[70:95].mean(), speed[225:245].mean()
    assert fast / slow == pytest.approx(1 / 0.3, rel=0.15)
    assert again / slow == pytest.approx(1.0, rel=0.15)


def test_random_pumps_and_valves_stay_stable(arm: Arm):
    rng = np.random.default_rng(5)
    n, command = 20, np.stack([pulses(rng, 300) for _ in range(7)], axis=1)
    pump = {
        "pump_flow": 10 ** rng.uniform(-1, 1.3, (n, 1)), "pump_droop": rng.choice([0, 20, 100], (n, 1)),
        "pump_idle": rng.uniform(0, 1, (n, 1)), "pump_rise": rng.choice([0, 0.3], (n, 1)),
        "line_volume": 10 ** rng.uniform(0.7, 3.3, (n, 1)),
    }  # fmt: skip
    p = changed(nominal(arm, SETTINGS), **pump)
    coarse, fine = HydraulicSettings(substeps=3), HydraulicSettings(substeps=20)
    runs = []
    for settings in (coarse, fine):
        runs.append(DrivenArm(arm, p, command, settings).run())
        assert np.isfinite(runs[-1]).all()
    assert np.median(np.degrees(abs(runs[0] - runs[1])).max(axis=(1, 2))) < 0.5
