"""What a sensor reads: its scale and lag against closed forms."""

import numpy as np

from hydroid.simulation.simulation import reading

TIME = 0.01 * np.arange(300)


def sensors(scale: float, lag: float) -> np.ndarray:
    return np.array([(scale, lag)], [("sensor_scale", float), ("sensor_lag", float)])


def test_a_plain_sensor_reads_the_angle_to_the_bit():
    angle = np.random.default_rng(0).normal(size=(50, 1))
    assert reading(angle, sensors(1.0, 0.0), 0.01) is angle


def test_a_lagging_sensor_follows_a_ramp_late():
    angle = 0.3 + 0.2 * TIME[:, None]
    seen = reading(angle, sensors(1.0, 0.15), 0.01)[:, 0]
    np.testing.assert_allclose(seen, 0.3 + 0.2 * (TIME - 0.15 * (1 - np.exp(-TIME / 0.15))), atol=1e-12)


def test_a_scale_acts_on_the_turn_since_the_start():
    angle = 0.3 + 0.2 * np.sin(TIME)[:, None]
    np.testing.assert_allclose(reading(angle, sensors(1.1, 0.0), 0.01), 0.3 + 1.1 * (angle - 0.3))
