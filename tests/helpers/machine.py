"""Logs of a machine that is like an arm's file, as a lab would write them: other names, other units."""

from pathlib import Path

import numpy as np

import hydroid
from hydroid.identified_model import identified
from hydroid.log import Log

FACTORS = {"open_A": 1.3, "open_B": 0.8, "dead_A": 1.6, "dead_B": 2.2, "lag": 2.0, "size": 1.2, "D": 0.7}
"""by which the machine's parameters differ from the nominal ones, by the beginning of their names"""


def moves(joints: int, seconds: float, period: float, seed: int) -> np.ndarray:
    """Steps of commands [%] between rests, shape (T, joints)."""
    rng, samples = np.random.default_rng(seed), round(seconds / period) + 1
    command = np.zeros((samples, joints))
    for joint in range(joints):
        at, sign = round(rng.uniform(1.0, 2.0) / period), 1.0 - 2.0 * (joint % 2)
        while at < samples:
            length = round(rng.uniform(0.4, 0.9) / period)
            command[at : at + length, joint] = sign * rng.uniform(25, 95)
            at, sign = at + length + round(rng.uniform(0.3, 1.0) / period), -sign
    return command


def write_log(
    project: Path, path: Path, seed: int = 0, seconds: float = 20.0, noise_deg: float = 0.05
) -> None:
    """Simulate the arm of a project's stage 2 at other values, and write commands in V and angles in rad."""
    model = hydroid.start_values(hydroid.load_settings(project / "fit.yaml"))
    values = {
        name: value * next((f for start, f in FACTORS.items() if name.startswith(start)), 1.0)
        for name, value in model.values.items()
    }
    truth = identified(model.settings, values, "the machine")
    arm, period = model.settings.arm, 0.01
    command = moves(len(arm.joints), seconds, period, seed)
    start = np.clip(0.0, arm.lower + 0.4, arm.upper - 0.4)
    angle = np.tile(start, (len(command), 1))
    log = Log("commands", period * np.arange(len(command)), command, angle, period)
    seen = hydroid.simulate(log, fit=truth, out=None, noise_deg=noise_deg, seed=seed).log.angle
    names = ["t_ms", *(f"valve_{n}_V" for n in arm.joint_names), *(f"enc_{n}_rad" for n in arm.joint_names)]
    rows = np.column_stack([1e3 * log.time, command / 10, seen])
    np.savetxt(path, rows, fmt="%.6g", delimiter=";", header=";".join(names), comments="")
