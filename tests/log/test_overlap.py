"""Copies and parts of a recording are found by their samples; other recordings are
not."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from log_files import RIG
from made_logs import TRUTH, noisy, stepped

from hydroid import load_settings, read_logs
from hydroid.log import Log
from hydroid.log.overlap import KNOWN, overlap

EXCAVATOR = RIG.parent / "excavator"
LOGS = [
    ("fit-mech", RIG / "rig_shoulder_1.csv", RIG / "rig_shoulder_2.csv"),
    (EXCAVATOR / "fit.yaml", EXCAVATOR / "fit_01.csv", EXCAVATOR / "fit_02.csv"),
]
"""settings, a recording, and another one of the same machine"""


def resampled(log: Log, period: float, shift: float = 0.0) -> Log:
    """The log on another clock, with straight lines between its samples."""
    time = np.arange(0.0, log.duration - shift, period)

    def on_time(signal: np.ndarray) -> np.ndarray:
        return np.column_stack(
            [np.interp(time + shift, log.time, column) for column in signal.T]
        )

    return replace(
        log,
        time=time,
        period=period,
        angle=on_time(log.angle),
        command=on_time(log.command),
    )


def rounded(log: Log, step_deg: float) -> Log:
    return replace(
        log, angle=np.radians(step_deg * np.round(np.degrees(log.angle) / step_deg))
    )


COPIES: dict[str, Callable[[Log], Log]] = {
    "itself": lambda log: log,
    "a piece": lambda log: log.part(137, len(log.time) - 53),
    "fewer digits": lambda log: rounded(log, 0.1),
    "between the samples": lambda log: resampled(log, log.period, 0.4 * log.period),
    "half the rate": lambda log: resampled(log, 2 * log.period),
    "half the rate and back": lambda log: resampled(
        resampled(log, 2 * log.period), log.period
    ),
    "no commands": lambda log: replace(log, command=0 * log.command),
}


@pytest.fixture(scope="module", params=LOGS, ids=["rig", "excavator"])
def logs(request: pytest.FixtureRequest) -> list[Log]:
    config, *files = request.param
    return read_logs([Path(file) for file in files], load_settings(config))


@pytest.mark.parametrize("copy", COPIES)
def test_a_copy_of_a_log_or_of_a_part_is_known(logs: list[Log], copy: str):
    one, other = logs
    assert overlap(COPIES[copy](one), [other, one]) >= 3 * KNOWN


def test_another_recording_is_not_known(logs: list[Log]):
    one, other = logs
    assert overlap(one, [other]) == 0
    assert overlap(one, []) == 0


def test_what_part_of_a_log_is_known_is_told(logs: list[Log]):
    one, _ = logs
    assert overlap(one, [one.part(0, len(one.time) // 2)]) == pytest.approx(
        0.5, abs=0.15
    )


def test_the_same_commands_with_noise_of_their_own_are_another_recording():
    settings = load_settings("article-mech")
    log = stepped(settings, TRUTH, [60.0, -80.0, 30.0, -40.0], dwell=2.0)
    once, again = noisy(log, 0.2, seed=1), noisy(log, 0.2, seed=2)
    assert overlap(again, [once]) == 0
    assert overlap(once, [once]) == 1


def test_a_log_in_which_nothing_moves_is_known_as_a_whole():
    time = np.arange(500) * 0.01
    still = Log("still", time, np.zeros((500, 2)), np.full((500, 2), 0.3), 0.01)
    assert overlap(still, [still]) == 1
    assert overlap(still, [replace(still, angle=still.angle + 0.1)]) == 0
