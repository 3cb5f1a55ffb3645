"""All joints of the arm under the plugin: stable, still, and the same in any company."""

import numpy as np
from hydraulic_arm import DrivenArm, scatter
from hydraulic_reference import pulses

from hydroid.hydraulics.records import Records, nominal_parameters
from hydroid.settings.arm import Arm
from hydroid.settings.hydraulics import HydraulicSettings

ALL = list(range(7))
SETTINGS = HydraulicSettings()


def candidates(arm: Arm, n: int, settings: HydraulicSettings = SETTINGS, seed: int = 0) -> Records:
    return scatter(nominal_parameters(arm, settings, ALL, n), np.random.default_rng(seed))


def commands(samples: int, joints: list[int], seed: int = 1) -> np.ndarray:
    rng = np.random.default_rng(seed)
    command = np.zeros((samples, 7))
    for j in joints:
        command[:, j] = pulses(rng, samples)
    return command


def test_seven_joints_at_once_are_stable_for_random_parameters(arm: Arm):
    """100 of the benchmark's 1,000 candidates; contacts and joint stops included."""
    command = commands(500, ALL)
    command[-150:] = 0.0
    driven = DrivenArm(arm, candidates(arm, 100), ALL, SETTINGS)
    velocity = np.diff(driven.run(command), axis=1) / 0.01
    speed = abs(velocity)
    assert not driven.failed.any()
    assert speed.max() < 5.0  # a full valve moves no joint faster than 2 rad/s
    # at rest some joints creep where leaking oil fills a void, but none chatters
    assert abs(np.diff(velocity[:, -30:], axis=1)).max() < 0.01
    assert np.median(speed.max(axis=(1, 2))) > 0.2


def test_the_arm_holds_its_pose_without_command(arm: Arm):
    tight = HydraulicSettings(leakage=0.0)
    driven = DrivenArm(arm, candidates(arm, 4, tight), ALL, tight)
    angle = driven.run(np.zeros((500, 7)))
    assert abs(angle - angle[:, :1]).max() < 1e-8


def test_company_threads_and_chunks_change_no_bit(arm: Arm):
    p, command = candidates(arm, 7), commands(150, ALL)
    together = DrivenArm(arm, p, ALL, SETTINGS, threads=2).run(command)
    apart = [DrivenArm(arm, p[i : i + 3].view(np.recarray), ALL, SETTINGS).run(command) for i in (0, 3, 6)]
    np.testing.assert_array_equal(together, np.concatenate(apart))


def test_seven_joints_converge_with_mujocos_step(arm: Arm):
    """Against the same arm at sixteen steps a sample, all joints driven."""
    p, command = nominal_parameters(arm, SETTINGS, ALL), commands(200, ALL, seed=3)
    exact = DrivenArm(arm, p, ALL, SETTINGS, steps=16).run(command)
    error = [abs(DrivenArm(arm, p, ALL, SETTINGS, k).run(command) - exact).max() for k in (1, 2, 4)]
    assert np.degrees(error[0]) < 0.5
    assert error[2] < 0.6 * error[1] < 0.36 * error[0]


def test_passive_joints_follow_the_shoulder(arm: Arm):
    """With the shoulder alone driven the others keep their springs and dampers, and feel it."""
    p, command = nominal_parameters(arm, SETTINGS, ALL), commands(300, [1])
    angle = DrivenArm(arm, p, [1], SETTINGS).run(command)[0]
    fine = DrivenArm(arm, p, [1], SETTINGS, steps=8).run(command)[0]
    swing = np.degrees(np.ptp(angle, axis=0))
    assert swing[1] > 3
    assert 0.01 < swing[2] < swing[1]
    assert np.degrees(abs(angle - fine).max()) < 0.1
