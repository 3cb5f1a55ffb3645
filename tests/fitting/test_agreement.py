"""Logs that agree are said to; one whose speeds, dead bands or delay differ from the
rest is named."""

from dataclasses import replace

import numpy as np
import pytest

from hydroid.fitting.agreement import compare_logs
from hydroid.fitting.baselines import Baseline
from hydroid.log import Log

RANGES = [(-np.inf, np.inf)]
PERIOD = 0.02


def log_of(
    seed: int, *, speed: float = 1.0, dead: float = 0.0, delay: float = 0.0
) -> Log:
    """A log of 60 s of a joint whose speed also wanders and depends on its angle."""
    rng = np.random.default_rng(seed)
    levels = rng.uniform(-100, 100, 30) * np.tile([1, 0], 15)
    command = np.concatenate([np.zeros(50), np.repeat(levels, 100)])
    numbers = np.array(
        [[20 + dead, 24 + dead], [1.4, 1.2], [0.35 * speed, -0.3 * speed], [0.08, 0.12]]
    )
    time = PERIOD * np.arange(len(command))
    log = Log(
        f"log_{seed}.csv", time, command[:, None], np.zeros((len(command), 1)), PERIOD
    )
    angle = Baseline(1, np.array([-9.0, 9.0]), 0.05 + delay, None, numbers).predict(log)
    slow = np.convolve(
        rng.normal(0, 1, len(command) + 500), np.ones(501) / np.sqrt(501), "valid"
    )
    steps = np.diff(angle, prepend=0.0) * (1 + 0.03 * slow) * (1 + 0.1 * np.sin(angle))
    return replace(
        log, angle=(np.cumsum(steps) + rng.normal(0, 5e-4, len(angle)))[:, None]
    )


@pytest.mark.parametrize("seed", range(0, 40, 12))
def test_no_log_stands_out_of_equal_ones(seed: int) -> None:
    (found,) = compare_logs([log_of(seed + k) for k in range(4)], RANGES)
    assert found.odd is None
    speed, sd = found.numbers[:, 0], found.sd[:, 0]
    assert (np.abs(speed - 1) < 3.5 * sd).all()


ODD = {"speed": (0, 0.8), "dead": (1, 10.0), "delay": (2, 0.15)}


@pytest.mark.parametrize("seed", range(0, 16, 8))
@pytest.mark.parametrize("kind", ODD)
def test_the_log_that_differs_is_named_with_its_difference(
    kind: str, seed: int
) -> None:
    number, value = ODD[kind]
    logs = [log_of(seed + k, **({kind: value} if k == 2 else {})) for k in range(4)]
    (found,) = compare_logs(logs, RANGES)
    assert found.odd == (2, number)
    assert abs(found.numbers[2, number] - value) < 3 * found.sd[2, number]


def test_two_logs_are_too_few_to_name_one() -> None:
    assert compare_logs([log_of(0), log_of(1, speed=0.5)], RANGES) == []


@pytest.mark.parametrize(
    "kind", ["at random", "against the command", "hardly driven", "one level"]
)
def test_logs_that_no_simple_model_explains_are_compared_all_the_same(
    kind: str,
) -> None:
    logs = [log_of(k) for k in range(3)]
    rng = np.random.default_rng(0)
    changed = list[Log]()
    for log in logs:
        steps = np.diff(log.angle, axis=0, prepend=log.angle[:1])
        angle, command = log.angle, log.command
        if kind == "at random":
            angle = np.cumsum(rng.normal(0, 0.01, angle.shape), axis=0)
        elif kind == "against the command":
            angle = np.cumsum(np.where(steps > 0, -2, 1) * steps, axis=0)
        elif kind == "hardly driven":
            command = command * (np.arange(len(command)) > len(command) - 5)[:, None]
        else:
            command = np.sign(command).clip(0)
        changed.append(replace(log, angle=angle, command=command))
    for found in compare_logs(changed, RANGES):
        assert np.isfinite(found.numbers).all()
        assert np.isfinite(found.sd).all()
