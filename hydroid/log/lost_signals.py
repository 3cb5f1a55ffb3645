"""Commands of a receiver that had no signal for a while: it gives 0 then, in a range that
does not hold 0."""

from dataclasses import replace

import numpy as np

from hydroid.log.signals import is_lost_signal
from hydroid.log.table import Recording

MOST_LOST = 0.05
"""part of the rows that may have no signal: more are another range"""


def without_lost_signals(recording: Recording) -> Recording:
    """Return a recording in which commands hold no number where there was no
    signal."""
    values = recording.values
    for place, signal in enumerate(recording.signals):
        if signal.kind != "command" or not is_lost_signal(signal.offset):
            continue
        lost = values[:, place] == signal.offset
        if 0 < lost.sum() <= MOST_LOST * len(lost):
            if values is recording.values:
                values = values.copy()
            values[lost, place] = np.nan
    return replace(recording, values=values)
