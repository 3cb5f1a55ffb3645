"""What a command is in: one table for `init`, `check` and the page on logs."""

from pathlib import Path

import numpy as np
import pytest

from hydroid.log import check_parts, guess_columns, open_table
from hydroid.log.signals import (
    SIGNALS,
    CommandRange,
    CommandSignal,
    likely_range,
    resting_range,
)
from hydroid.settings.log import LogSettings

PAGE = Path(__file__).parents[2] / "docs" / "logs.md"
T = np.arange(2000) * 0.02
STEPS = np.repeat([0.0, 100, 0, -100, 40, 0, -70, 0, 100, 0], 200)
"""a command [%] that begins with rest and is given whole both ways"""


def cells(signal: CommandSignal) -> np.ndarray:
    return signal.middle + signal.half * STEPS / 100


@pytest.mark.parametrize("signal", SIGNALS, ids=lambda signal: signal.name)
def test_each_signal_is_recognised_and_brought_to_percent(
    signal: CommandSignal, tmp_path: Path
) -> None:
    likely = likely_range(cells(signal), unit=signal.unit)
    assert isinstance(likely, CommandRange)
    assert likely.name == signal.name
    np.testing.assert_allclose(
        likely.scale * cells(signal) + likely.offset, STEPS, atol=1e-9
    )


UNITS = {
    "pulses of 1 to 2 ms": "ms",
    "1000 to 2000 µs": "us",
    "6 to 18 V": "V",
    "±24 V": "V",
    "±10000 mV": "mV",
    "4 to 20 mA": "mA",
}


@pytest.mark.parametrize("signal", SIGNALS, ids=lambda signal: signal.name)
def test_init_writes_its_scale_and_offset(
    signal: CommandSignal, tmp_path: Path
) -> None:
    unit = UNITS.get(signal.name, "")
    name = f"cmd_boom_{unit}" if unit else "cmd_boom"
    path = tmp_path / "log.csv"
    table = np.stack([T, cells(signal), 20 * np.sin(0.4 * T)], axis=1)
    np.savetxt(
        path, table, delimiter=",", header=f"time_s,{name},angle_boom", comments=""
    )
    command = LogSettings.model_validate(
        guess_columns([open_table(path)], ["boom"]).log
    ).columns("command", 1)
    assert command is not None
    np.testing.assert_allclose(
        command.scale * cells(signal) + command.offset, STEPS, atol=1e-9
    )


def test_the_page_has_each_signal() -> None:
    page = PAGE.read_text()
    for signal in SIGNALS:
        assert row(signal) in page


def row(signal: CommandSignal) -> str:
    _, scale, offset = signal.range
    rest = f", {signal.middle:g} at rest" if signal.low >= 0 else ""
    return f"| {signal.name}{rest} | {scale:.6g} | {f'{offset:.6g}'.replace('-', '−') if offset else ''} |\n"


PULSES = 1500 + 5 * STEPS


@pytest.mark.parametrize(
    "pulses",
    [
        np.where((T > 9) & (T < 9.5), 0, PULSES),
        1500 + 5 * STEPS.clip(0),
        1500 + 5 * STEPS.clip(max=0),
    ],
    ids=["0 without a signal", "up alone", "down alone"],
)
def test_pulses_are_known_in_half_and_with_lost_signals(pulses: np.ndarray) -> None:
    likely = likely_range(pulses)
    assert likely is not None
    assert likely.name == "1000 to 2000 µs"
    # a lost signal makes the range no wider
    assert likely.with_overshoot(pulses) == likely


def test_a_command_that_never_changes_has_the_range_of_the_others(
    tmp_path: Path,
) -> None:
    path = tmp_path / "log.csv"
    angle = 20 * np.sin(0.4 * T)
    table = np.stack([T, PULSES, 0 * T + 1500, angle, angle], axis=1)
    names = "time_s,cmd_boom,cmd_stick,angle_boom,angle_stick"
    np.savetxt(path, table, delimiter=",", header=names, comments="")
    section = guess_columns([open_table(path)], ["boom", "stick"]).log
    command = LogSettings.model_validate(section).columns("command", 2)
    assert command is not None
    assert command.scale * 1500 + command.offset == 0


@pytest.mark.parametrize(
    "steps", [STEPS.clip(0), STEPS / 2, np.zeros(2000)], ids=["one way", "half", "none"]
)
def test_a_command_in_percent_stays_one(steps: np.ndarray) -> None:
    likely = likely_range(steps)
    assert likely is None or likely.name == "%"


def test_a_joystick_of_bytes_that_is_often_at_its_end_is_none_from_0_to_100() -> None:
    """Its 0 is a whole command: it rests at 127, first and mostly."""
    likely = likely_range(np.round(127 + 1.27 * STEPS))
    assert likely is not None
    assert likely.name == "bytes around 127"


NOISE = np.round(np.random.default_rng(1).normal(0, 2, len(STEPS)))


@pytest.mark.parametrize(
    ("counts", "name", "rest"),
    [
        (2047 + 20.47 * STEPS, "0 to 4095", 2047),
        (2047 + 20.47 * STEPS.clip(0), "0 to 4095", 2047),
        (2347 + 17 * STEPS, "0 to 4095", 2347),
        (2130 + 0 * STEPS, "0 to 4095", 2130),
        (9 * STEPS, "±1000", 0),
        (18 * STEPS, "±2047", 0),
        (31000 + 150 * STEPS, "0 to 65535", 31000),
    ],
)
def test_noisy_counts_have_the_range_in_which_they_rest(
    counts: np.ndarray, name: str, rest: float
) -> None:
    """Whether they are given on both sides, on one, or never."""
    values = np.round(counts) + NOISE
    likely = likely_range(values)
    assert likely is not None
    assert likely.name == name
    _, around = resting_range(values, likely, None) or (0.0, likely)
    assert abs(around.scale * rest + around.offset) < 0.1


def test_counts_around_0_of_one_log_have_one_scale(tmp_path: Path) -> None:
    """`init` and `check` alike."""
    path = tmp_path / "log.csv"
    joints = ["boom", "stick"]
    names = ["time_s", *(f"cmd_{n}" for n in joints), *(f"angle_{n}" for n in joints)]
    columns = [T, 18 * STEPS, 9 * STEPS, 20 * np.sin(0.4 * T), 20 * np.cos(0.3 * T)]
    header = ",".join(names)
    np.savetxt(path, np.stack(columns, 1), delimiter=",", header=header, comments="")
    guess = guess_columns([open_table(path)], joints)
    settings = LogSettings.model_validate(guess.log)
    for joint in (1, 2):
        command = settings.columns("command", joint)
        assert command is not None
        assert command.scale == pytest.approx(100 / 2047)
        guess.log["joints"][joint]["command"].pop("scale")
    settings = LogSettings.model_validate(guess.log)
    ranges = dict.fromkeys(joints, (-np.inf, np.inf))
    _, findings = check_parts(path, settings, ranges)
    hints = [one.hint for one in findings if one.level == "error"]
    assert len(hints) == 2
    assert all("in ±2047" in hint for hint in hints)


def test_a_command_that_is_never_near_0_tells_no_range(tmp_path: Path) -> None:
    """Of one that tells it the others have theirs, and rest where they begin."""
    path = tmp_path / "log.csv"
    joints = ["swing", "boom", "stick"]
    names = ["time_s", *(f"cmd_{n}" for n in joints), *(f"angle_{n}" for n in joints)]
    duty = [7.47 + 0.025 * STEPS, 6.9 + 0.005 * STEPS, 0 * STEPS + 7.6]
    columns = [T, *duty, *(20 * np.sin(k * T) for k in (0.2, 0.3, 0.4))]
    header = ",".join(names)
    np.savetxt(path, np.stack(columns, 1), delimiter=",", header=header, comments="")
    settings = LogSettings.model_validate(guess_columns([open_table(path)], joints).log)
    for joint, cell in enumerate((7.47, 6.9, 7.6), 1):
        command = settings.columns("command", joint)
        assert command is not None
        assert command.scale == pytest.approx(40, rel=0.05)
        assert command.scale * cell + command.offset == pytest.approx(0, abs=0.01)
