"""ROS bags and MCAP whose topics have clocks of their own: within the error of linear
interpolation."""

from pathlib import Path

import numpy as np
import pytest
from log_files import faults, read
from log_formats import BagWriter

from hydroid.log import check_parts, guess_columns, open_table
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


def write(
    folder: Path, kind: str, *, gap: tuple[float, float] = (9, 9)
) -> tuple[Path, float]:
    """A bag of 8 s: angles at about 70 Hz, recorded 30 ms late in other order; commands
    every 0.5 s."""
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
                message = bag.joints(
                    START + time, ["stick", "boom"], position(time)[::-1].copy()
                )
                bag.write("/joint_states", START + time + 0.03, message)
                longest, last = max(longest, time - last), time
    if kind == "mcap":
        # as other recorders write it: without the folder's metadata
        (path,) = path.glob("*.mcap")
    return path, longest


@pytest.mark.parametrize("kind", KINDS)
def test_unsynchronised_topics_come_to_one_clock(kind: str, tmp_path: Path) -> None:
    path, step = write(tmp_path, kind)
    log, findings = read(path, SETTINGS, RANGES)
    # the first angle, after START
    at = log.time + np.random.default_rng(3).uniform(0.008, 0.02)
    true = np.array([position(t) for t in at])
    bound = 0.8 * RATE**2 * step**2 / 8  # of a chord over the longest step
    assert np.abs(log.angle - true).max() < bound < 1e-3
    # a command holds from its message on, and counts in a sample for as long as it
    # holds there
    messages = 0.5 * np.arange(17)
    levels = np.array([command(t) for t in messages])
    since = (
        (at[:, None] - messages).clip(0, 0.5),
        (at[:, None] + 0.01 - messages).clip(0, 0.5),
    )
    np.testing.assert_allclose(
        log.command, (since[1] - since[0]) @ levels / 0.01, atol=1e-3
    )
    assert "/joint_states, /valves/command: resampled to 0.01 s" in [
        finding.what for finding in findings
    ]


def errors(path: Path, settings: LogSettings = SETTINGS) -> str:
    said = " ".join(map(str, faults(path, settings, RANGES)))
    assert said.isprintable()
    return said


def test_a_gap_in_the_angles_splits_the_log(tmp_path: Path) -> None:
    """Both parts hold what the log without a gap holds there."""
    path, _ = write(tmp_path, "ros2", gap=(4, 4.4))
    (tmp_path / "whole").mkdir()
    whole, _ = read(write(tmp_path / "whole", "ros2")[0], SETTINGS, RANGES)
    parts, findings = check_parts(path, SETTINGS, RANGES)
    assert [part.source for part in parts] == [f"{path}[1]", f"{path}[2]"]
    assert "0.42 s without a sample" in str(findings[0])
    for part in parts:
        first = round(part.begin / 0.01)
        rows = slice(first, first + len(part.time))
        np.testing.assert_allclose(part.angle, whole.angle[rows], atol=1e-9)
        np.testing.assert_allclose(part.command, whole.command[rows], atol=1e-9)


def test_bad_bags_are_refused_in_one_line(tmp_path: Path) -> None:
    path, _ = write(tmp_path, "mcap")
    other = LogSettings.model_validate(
        {"command": {"column": "/valve.data[{joint}]"}, "angle": None}
    )
    assert "lacks '/valve.data[1]' (command of joint 1, did you mean" in errors(
        path, other
    )
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(path.read_bytes()[:200])
    assert "cannot be read as a bag" in errors(cut)
    one, _ = write(tmp_path, "ros1")
    one.write_bytes(one.read_bytes()[:5000])
    assert "cannot be read as a bag" in errors(one)


def two_topics(
    folder: Path, kind: str, commands: dict[float, float], clock=lambda time: time
) -> Path:
    """A bag of 4 s: angles every 0.02 s of a clock; commands [V] of joint 1 by their
    time."""
    path = folder / ("log.bag" if kind == "ros1" else "log")
    with BagWriter(path, kind) as bag:
        for k in range(200):
            time = 0.02 * k
            bag.write(
                "/joint_states",
                START + time,
                bag.joints(START + clock(time), NAMES, position(time)),
            )
            for volts in (
                value for at, value in commands.items() if time <= at < time + 0.02
            ):
                bag.write(
                    "/valves/command", START + time, bag.array(np.array([volts, 2.5]))
                )
    return path


NAMES = ["boom", "stick"]
VOLTS = SETTINGS.changed(
    {"command.scale": 40.0, "command.offset": -100.0, "period_s": 0.02}
)


@pytest.mark.parametrize("kind", KINDS)
def test_before_its_first_message_a_command_is_zero_percent_and_not_zero_volts(
    kind, tmp_path
) -> None:
    path = two_topics(tmp_path, kind, {1.0: 4.0, 2.0: 1.0})
    log, _ = read(path, VOLTS, RANGES)
    expected = np.select(
        [log.time >= 2.0 - 1e-9, log.time >= 1.0 - 1e-9], [-60.0, 60.0], 0.0
    )
    np.testing.assert_allclose(log.command[:, 0], expected, atol=1e-6)
    np.testing.assert_allclose(log.command[:, 1], 0.0, atol=1e-9)


def test_the_range_of_a_command_that_starts_late_is_guessed_from_its_messages(
    tmp_path: Path,
) -> None:
    volts = {
        0.5 + 0.1 * k: 2.5 if k % 3 == 0 else 2.5 + 2.4 * np.sin(k) for k in range(30)
    }
    table = open_table(two_topics(tmp_path, "ros2", volts))
    (command,) = [
        entry["command"]
        for entry in guess_columns([table], NAMES).log["joints"].values()
    ][:1]
    assert (command["scale"], command["offset"]) == (40.0, -100.0)


def test_a_clock_that_goes_back_is_refused(tmp_path: Path) -> None:
    """The publisher's alone, or also the recorder's, whose messages rosbags would
    interleave."""
    path = two_topics(
        tmp_path, "ros2", {0.0: 3.0}, lambda time: time if time < 2 else time - 1.005
    )
    assert (
        "topic /joint_states, message 101: time does not increase: 0.995 s follows 1.98"
        in errors(path)
    )
    with BagWriter(tmp_path / "recorder", "ros2") as bag:
        for k in range(200):
            time = 0.02 * k if k < 100 else 0.02 * k - 1.005
            bag.write(
                "/joint_states",
                START + time,
                bag.joints(START + time, NAMES, position(time)),
            )
            bag.write("/valves/command", START + time, bag.array(np.zeros(2)))
    said = errors(tmp_path / "recorder")
    assert (
        "topic /valves/command, message 101: time does not increase: 0.995 s follows 1.98"
        in said
    )


@pytest.mark.parametrize("kind", KINDS)
def test_one_time_with_two_values_is_refused_and_a_message_that_came_twice_is_not(
    kind, tmp_path
) -> None:
    path = two_topics(tmp_path, kind, {0.0: 3.0}, lambda time: min(time, 3.0))
    assert (
        "topic /joint_states, message 152: time does not increase: 3 s follows 3 s"
        in errors(path)
    )
    twice = tmp_path / ("twice.bag" if kind == "ros1" else "twice")
    with BagWriter(twice, kind) as bag:
        for k in range(200):
            time = 0.02 * k
            bag.write("/valves/command", START + time, bag.array(np.zeros(2)))
            for late in (0.0, 0.001):  # as of a relay
                bag.write(
                    "/joint_states",
                    START + time + late,
                    bag.joints(START + time, NAMES, position(time)),
                )
    assert len(read(twice, VOLTS, RANGES)[0].time) == 200


def test_a_wrong_stamp_does_not_fill_the_memory(tmp_path: Path) -> None:
    path = two_topics(
        tmp_path, "mcap", {0.0: 3.0}, lambda time: time if time else 1e8 - START
    )
    assert "rows; at most 30,000,000 rows of 1 columns can be read" in errors(path)


@pytest.mark.parametrize("kind", ["ros1", "ros2"])
def test_a_message_that_is_damaged_is_left_out(kind: str, tmp_path: Path) -> None:
    path, _ = write(tmp_path, kind)
    file = path if path.is_file() else next(path.glob("*.db3"))
    data = file.read_bytes()
    third = command(2.0).tobytes()
    place = data.index(third)
    # the length stands before the numbers
    file.write_bytes(data[: place - 8] + b"\xff" * 8 + data[place:])
    log, findings = read(path, SETTINGS, RANGES)
    assert "/valves/command: 1 of 15 messages cannot be read" in [
        finding.what for finding in findings
    ]
    assert log.driven.all()
