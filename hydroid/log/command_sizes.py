"""Whether a joint's commands in a direction have one size: those of a valve that is
open or shut.

They tell one speed, and nothing of what lies between.
"""

from collections.abc import Sequence

import numpy as np

from hydroid.arrays import Array
from hydroid.log.log import LEAST_COMMAND, Log

ONE_SIZE = 5.0
"""commands of one size differ by less, from the tenth to the ninetieth percentile
[%]"""


def one_size(sizes: Array, weights: Array) -> bool:
    """Return whether commands are of one size, from ascending sizes [%] and their
    weights, each (n,)."""
    if len(sizes) == 0:
        return True
    reached = np.cumsum(weights) / weights.sum()
    low, high = np.interp([0.1, 0.9], reached, sizes)
    return bool(high - low < ONE_SIZE)


def only_command(logs: Sequence[Log], joint: int, sign: float) -> float | None:
    """Return the size of the commands that a joint (number, from 1) gets in a direction
    (1 or -1) [%].

    None where they have several sizes, or there are none.
    """
    commands = np.concatenate([log.command_of(joint) for log in logs])
    # those of the other direction become negative, and are left out
    sizes = sign * commands
    sizes = np.sort(sizes[sizes >= LEAST_COMMAND])
    if len(sizes) == 0:
        return None
    weights = np.ones(len(sizes))
    if not one_size(sizes, weights):
        return None
    return float(np.median(sizes))
