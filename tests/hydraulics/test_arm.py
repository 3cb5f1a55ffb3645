"""All joints of the arm under the plugin: stable, still, and the same in any
company."""

import numpy as np
from hydraulic_arm import DrivenArm, nominal
from hydraulic_reference import TEN, draw, pulses

from hydroid.settings.arm import Arm
from hydroid.settings.hydraulics import HydraulicSettings

SETTINGS = HydraulicSettings()


def commands(samples: int, seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return np.stack([pulses(rng, samples) for _ in range(7)], axis=1)


def test_seven_joints_at_once_are_stable_for_random_parameters(arm: Arm):
    """100 candidates of the whole search space, 0.25 to 2.5 times nominal; joint stops
    included."""
    joints, command = nominal(arm, SETTINGS, 100), commands(500, 1)
    for name, values in draw(np.random.default_rng(0), joints.size).items():
        joints[name] *= np.reshape(values / TEN[name], joints.shape)
    command[-150:] = 0.0
    angle = DrivenArm(arm, joints, command, SETTINGS).run()
    velocity = np.diff(angle, axis=1) / 0.01
    speed = abs(velocity)
    assert np.isfinite(angle).all()
    assert speed.max() < 5.0  # a full valve moves no joint faster than 2 rad/s
    # at rest some joints creep where leaking oil fills a void, but none chatters
    assert abs(np.diff(velocity[:, -30:], axis=1)).max() < 0.01
    assert np.median(speed.max(axis=(1, 2))) > 0.2


def test_seven_joints_converge_with_mujocos_step(arm: Arm):
    p, command = nominal(arm, SETTINGS), commands(200, 3)
    exact = DrivenArm(arm, p, command, SETTINGS, steps=16).run()
    error = [
        abs(DrivenArm(arm, p, command, SETTINGS, k).run() - exact).max()
        for k in (1, 2, 4)
    ]
    assert np.degrees(error[0]) < 0.5
    assert error[2] < 0.6 * error[1] < 0.36 * error[0]
