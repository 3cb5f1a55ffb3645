"""ROS bags and MCAP whose topics have clocks of their own: within the error of linear interpolation."""

from pathlib import Path

import numpy as np
import pytest
from log_files import faults, read
from log_formats import BagWriter

from hydroid.settings.log import LogSettings

KINDS = ("ros1", "ros2", "mcap")
RANGES = {"1": (-2.0, 2.0), "2": (-2.0, 2.0)}
RATE = 1.2  # [rad/s], of the sines below
START = 1_700_000_000.0
SETTINGS = LogSettings.model_validate(
    {
        "command": {"column": "/valves/command.data[{joint}]"},
        "angle": {"unit": "rad"},
        "joints": {
            1: {"angle": {"column": "/joint_states.position[boom]"}},
            2: {"angle": {"column": "/joint_states.position[stick]"}},
        },
    }
)


def position(time: float) -> np.ndarray:
    return np.array([0.8 * np.sin(RATE * time), 0.5 * np.cos(RATE * time)])


def command(time: float) -> np.ndarray:
    """New commands every 0.5 s, from 1 s on."""
    k = int(time / 0.5 + 1e-9)
    return np.array([60 * np.cos(2.0 * k), 40 * np.sin(3.0 * k)]) * (time >= 1)


def write(folder: Path, kind: str, *, gap: tuple[float, float] = (9, 9)) -> tuple[Path, float]:
    """A bag of 8 s: angles at about 70 Hz, recorded 30 ms late in other order; commands every 0.5 s."""
    path = folder / ("log.bag" if kind == "ros1" else "log")
    rng = np.random.default_rng(3)
    longest = last = 0.0
    with BagWriter(path, kind) as bag:
        events = [(t, "angle") for t in np.cumsum(rng.uniform(0.008, 0.02, 570))]
        events += [(0.5 * k, "command") for k in range(2, 17)]
        for time, what in sorted(events):
            if what == "command":
                bag.write("/valves/command", START + time, bag.array(command(time)))
            elif not gap[0] < time < gap[1]:
                message = bag.joints(START + time, ["stick", "boom"], position(time)[::-1].copy())
                bag.write("/joint_states", START + time + 0.03, message)
                longest, last = max(longest, time - last), time
    if kind == "mcap":
        (path,) = path.glob("*.mcap")  # as other recorders write it: without the folder's metadata
    return path, longest


@pytest.mark.parametrize("kind", KINDS)
def test_unsynchronised_topics_come_to_one_clock(kind: str, tmp_path: Path) -> None:
    path, step = write(tmp_path, kind)
    log, findings = read(path, SETTINGS, RANGES)
    at = log.time + np.random.default_rng(3).uniform(0.008, 0.02)  # the first angle, after START
    true = np.array([position(t) for t in at])
    bound = 0.8 * RATE**2 * step**2 / 8  # of a chord over the longest step
    assert np.abs(log.angle - true).max() < bound < 1e-3
    # a command holds from its message on, and counts in a sample for as long as it holds there
    messages = 0.5 * np.arange(17)
    levels = np.array([command(t) for t in messages])
    since = (at[:, None] - messages).clip(0, 0.5), (at[:, None] + 0.01 - messages).clip(0, 0.5)
    np.testing.assert_allclose(log.command, (since[1] - since[0]) @ levels / 0.01, atol=1e-3)
    assert "/joint_states, /valves/command: resampled to 0.01 s" in [finding.what for finding in findings]


def errors(path: Path, settings: LogSettings = SETTINGS) -> str:
    said = " ".join(map(str, faults(path, settings, RANGES)))
    assert said.isprintable()
    return said


def test_a_gap_in_the_angles_is_a_fault(tmp_path: Path) -> None:
    path, _ = write(tmp_path, "ros2", gap=(4, 4.4))
    assert "/joint_states.position[boom]: no value is there (and" in errors(path)


def test_bad_bags_are_refused_in_one_line(tmp_path: Path) -> None:
    path, _ = write(tmp_path, "mcap")
    other = LogSettings.model_validate({"command": {"column": "/valve.data[{joint}]"}, "angle": None})
    assert "lacks '/valve.data[1]' (command of joint 1, did you mean" in errors(path, other)
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(path.read_bytes()[:200])
    assert "cannot be read as a bag" in errors(cut)
    one, _ = write(tmp_path, "ros1")
    one.write_bytes(one.read_bytes()[:5000])
    assert "cannot be read as a bag" in errors(one)
