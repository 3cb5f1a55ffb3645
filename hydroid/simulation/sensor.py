"""What an angle sensor reads: the turn since the start times a scale, with a first-order lag (ours)."""

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from hydroid.parameters import Array


def reading(angle: Array, sensors: NDArray[np.void], period: float) -> Array:
    """Return what the sensors of K joints read, shape (T, K) like their angles [rad], `period` [s] apart.

    Between samples an angle is taken for a straight line. A reading starts at the angle, at rest. With scale
    1 and no lag it is the angle, to the bit.
    """
    scale, lag = sensors["sensor_scale"], sensors["sensor_lag"]
    if np.all(scale == 1.0) and np.all(lag == 0.0):
        return angle
    turned = scale * (angle - angle[0])
    for k in np.flatnonzero(lag):
        left = np.exp(-period / lag[k])
        mean = (1.0 - left) * lag[k] / period
        turned[:, k] = lfilter([1.0 - mean, mean - left], [1.0, -left], turned[:, k])
    return angle[0] + turned
