"""Speeds against commands as logs show them, and the valve that has these speeds."""

from collections.abc import Callable, Sequence

import numpy as np
import pytest

from hydroid.fitting.speed_curve import SpeedCurve, measured_speeds
from hydroid.fitting.valve_start import fitted_valve, valve_start
from hydroid.hydraulics.valve import KNOTS, bent_opening
from hydroid.log import Log

PERIOD, LAG = 0.02, 0.05
RANGE = np.radians([-60.0, 60.0])
Speed = Callable[[float], float]


def power(dead: Sequence[float], exponent: float, full_deg: float) -> Speed:
    """Speed [rad/s] of a command [%]; dead bands of positive and negative ones [%]."""

    def speed(command: float) -> float:
        band = dead[0] if command > 0 else dead[1]
        beyond = max(abs(command) - band, 0.0) / (100.0 - band)
        return np.sign(command) * np.radians(full_deg) * beyond**exponent

    return speed


def table(commands: Sequence[float], speeds_deg: Sequence[float]) -> Speed:
    return lambda u: np.sign(u) * np.radians(np.interp(abs(u), commands, speeds_deg))


def driven(
    speed: Speed,
    delay: float = 0.2,
    levels: Sequence[float] | None = None,
    seed: int = 0,
    noise_deg=0.03,
) -> Log:
    """A log of one joint for 100 s, by commands held for 0.4 to 2 s, of random size or
    of `levels` [%]."""
    rng = np.random.default_rng(seed)
    steps = round(100 / PERIOD)
    command, angle = np.zeros(steps), np.zeros(steps)
    left, now, late = round(1 / PERIOD), 0.0, round(delay / PERIOD)
    for k in range(1, steps):
        left -= 1
        command[k] = command[k - 1]
        if left <= 0:
            left = round(rng.uniform(0.4, 2.0) / PERIOD)
            way = (
                -np.sign(angle[k - 1])
                if abs(angle[k - 1]) > 0.7 * RANGE[1]
                else rng.choice([-1, 1])
            )
            command[k] = way * (
                rng.uniform(5, 100) if levels is None else rng.choice(levels)
            )
        target = speed(command[k - late]) if k >= late else 0.0
        now += (target - now) * PERIOD / LAG
        angle[k] = np.clip(angle[k - 1] + PERIOD * now, *RANGE)
    angle += np.radians(noise_deg) * rng.normal(size=steps)
    return Log(
        "driven", np.arange(steps) * PERIOD, command[:, None], angle[:, None], PERIOD
    )


def sides(log: Log) -> tuple[SpeedCurve, SpeedCurve]:
    curve = measured_speeds([log], 1)
    assert curve is not None
    return curve.side(1), curve.side(-1)


def predicted(side: SpeedCurve, commands: np.ndarray) -> np.ndarray:
    """Speeds of the valve that a side starts with [deg/s]."""
    start = valve_start(side)
    assert start is not None
    share = np.maximum(commands - start.dead_band, 0.0) / (100.0 - start.dead_band)
    ends = tuple(knot**start.exponent for knot in KNOTS)
    return np.degrees(start.speed) * bent_opening(
        share**start.exponent, start.factors, ends
    )


def test_a_curve_never_falls_and_has_the_delay_with_the_lag():
    curve = measured_speeds([driven(power((20, 20), 1.5, 30), delay=0.3)], 1)
    assert curve is not None
    assert curve.delay == pytest.approx(0.3 + LAG, abs=0.03)
    assert (np.diff(curve.command) >= 0).all()
    assert (np.diff(curve.speed) >= 0).all()


def test_dead_bands_of_a_spool_whose_neutral_is_off_centre_are_those_of_its_sides():
    a, b = (valve_start(side) for side in sides(driven(power((17, 60), 1.3, 30))))
    assert a is not None
    assert b is not None
    assert (a.dead_band, b.dead_band) == pytest.approx((17, 60), abs=4)
    assert (a.speed, b.speed) == pytest.approx((np.radians(30),) * 2, rel=0.1)


@pytest.mark.parametrize(
    "speed",
    [
        power((30, 10), 0.8, 30),
        power((30, 10), 2.4, 30),
        table((20, 25, 30, 60, 100), (0, 12, 15, 18, 20)),
        table((10, 30, 50, 60, 100), (0, 2, 4, 20, 24)),
    ],
    ids=["root", "square", "all at once", "bends twice"],
)
def test_a_valve_starts_at_the_speeds_of_the_log(speed: Speed):
    commands = np.array([15.0, 35.0, 48.0, 65.0, 80.0, 95.0])
    for sign, side in zip((1, -1), sides(driven(speed)), strict=True):
        true = np.degrees([sign * speed(sign * u) for u in commands])
        np.testing.assert_allclose(predicted(side, commands), true, atol=4.1)


def test_commands_of_one_size_tell_a_speed_and_no_curve():
    for side in sides(driven(power((20, 20), 2.0, 25), levels=[100])):
        start = valve_start(side)
        assert start is not None
        assert start.one_size
        assert start.factors == (1.0, 1.0, 1.0, 1.0)
        assert np.degrees(start.speed) == pytest.approx(25, rel=0.05)


def test_what_stands_at_an_end_is_no_speed():
    """A sensor that ends before the joint does, as a draw wire, reads its end while the
    joint is driven."""
    speed = power((20, 20), 1.2, 40)
    log = driven(speed, levels=[60, 100], noise_deg=0.0)
    clipped = Log(
        "clipped",
        log.time,
        log.command,
        np.maximum(log.angle, np.radians(-15.0)),
        PERIOD,
    )
    for log_side, own in zip(sides(log), sides(clipped), strict=True):
        at = np.array([60.0, 100.0])
        np.testing.assert_allclose(
            predicted(own, at), predicted(log_side, at), rtol=0.08
        )


def test_a_turned_command_turns_the_valve():
    log = driven(power((15, 40), 1.3, 30))
    turned = Log("turned", log.time, -log.command, log.angle, PERIOD)
    one, other = fitted_valve([log], 1), fitted_valve([turned], 1)
    assert one is not None
    assert other is not None
    assert [s.dead_band for s in other.turned.sides] == pytest.approx(
        [s.dead_band for s in one.sides], abs=0.1
    )
    assert [s.speed for s in other.turned.sides] == pytest.approx(
        [s.speed for s in one.sides], rel=0.01
    )


def test_a_joint_that_follows_its_valve_shows_delay_lag_and_dead_bands():
    valve = fitted_valve(
        [
            driven(power((17, 60), 1.3, 30), delay=0.3),
            driven(power((17, 60), 1.3, 30), 0.3),
        ],
        1,
    )
    assert valve is not None
    # a command moves the joint from its own sample on, and a step leaves 1 - PERIOD /
    # LAG of the error
    lag = -PERIOD / np.log(1.0 - PERIOD / LAG)
    assert (valve.delay, valve.lag) == pytest.approx((0.3 - PERIOD, lag), abs=0.01)
    assert [side.dead_band for side in valve.sides] == pytest.approx([17, 60], abs=1.0)
    assert [np.degrees(side.speed) for side in valve.sides] == pytest.approx(
        [30, 30], rel=0.02
    )


def test_a_valve_predicts_a_log_that_it_has_not_seen():
    speed = power((17, 60), 1.3, 30)
    valve = fitted_valve([driven(speed)], 1)
    assert valve is not None
    other = driven(speed, seed=1, noise_deg=0.0)
    assert (
        np.degrees(np.abs(valve.baseline(1, tuple(RANGE)).errors([other])).max()) < 1.5
    )


def test_a_joint_that_no_log_drives_has_no_curve():
    log = driven(power((15, 40), 1.3, 30))
    still = Log("still", log.time, 0 * log.command, log.angle, PERIOD)
    assert measured_speeds([still], 1) is None
