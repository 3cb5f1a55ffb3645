"""Whether a joint's commands in a direction have one size: those of a valve that is
open or shut.

They tell one speed, and nothing of what lies between.
"""

from collections.abc import Sequence

import numpy as np

from hydroid.arrays import Array
from hydroid.log.log import LEAST_COMMAND, Log

HELD = 0.5
"""time for which the logs give a command, in all, that counts as one of them [s]"""
PART = 0.02
"""part of the logs that is enough of short ones"""
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


def largest_commands(logs: Sequence[Log], joint: int) -> tuple[float, float]:
    """Return the largest negative and positive commands that a joint (number, from 1)
    gets for HELD in all [%]: a jerk shows no speed; 0 of a direction without."""
    commands = np.concatenate([log.command_of(joint) for log in logs])
    seconds = np.concatenate([np.full(len(log.time), log.period) for log in logs])
    # 0.0 - 0.0 has no sign
    return 0.0 - _largest(-commands, seconds), _largest(commands, seconds)


def _largest(commands: Array, seconds: Array) -> float:
    """Return the largest command, and 0 at least, that lasts for HELD in all."""
    held = min(HELD, PART * float(seconds.sum()))
    order = np.argsort(-commands, kind="stable")
    enough = np.cumsum(seconds[order]) >= held
    return max(float(commands[order][np.argmax(enough)]), 0.0)


def smallest_commands(logs: Sequence[Log], joint: int) -> dict[float, float]:
    """Return the sizes of the smallest commands of a joint (number, from 1) that are
    more than noise [%], by sign, 1.0 or -1.0; none of a direction without commands."""
    commands = np.concatenate([log.command_of(joint) for log in logs])
    smallest = dict[float, float]()
    for sign in (1.0, -1.0):
        sizes = sign * commands
        sizes = sizes[sizes >= LEAST_COMMAND]
        if len(sizes):
            # a ramp passes small commands in no time
            smallest[sign] = float(np.percentile(sizes, 5))
    return smallest


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
