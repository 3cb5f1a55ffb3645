"""Whether a fit predicts better than a simple model: errors compared in pairs,
with a standard error.

Both predict the same starts, so that a hard part of a log is hard for both, and the
difference of their squared errors is what counts. Starts 2 s apart overlap, and what a
model gets wrong lasts: neighbours are no independent evidence. So the differences are
summed over blocks of BLOCK or longer, and the sums scatter as far as the mean is
uncertain (batch means; over blocks of unequal length the variance of a ratio). Of whole
logs each is a block.

The fit is *better* or *worse* where the difference is beyond the 95 % quantile of
Student's distribution, 1.64 standard errors where blocks are many. Else, and of fewer
than LEAST_BLOCKS, it *cannot be told*.
"""

from collections.abc import Sequence

import numpy as np
from scipy.stats import t as student

from hydroid.arrays import Array
from hydroid.joint_verdict import Comparison, Outcome

BLOCK = 10.0
"""shortest block of a log [s]"""
LEAST_BLOCKS = 4
"""fewer tell nothing"""
ONE_SIDED = 0.95
"""probability that a difference of none stays below what counts as one"""


def in_blocks(errors: Array, between: float) -> list[Array]:
    """Return the errors of a log's starts, (N,), in blocks of BLOCK or longer.

    Starts are `between` apart [s]. A shorter log is one block.
    Starts whose error is NaN do not count.
    """
    there = errors[~np.isnan(errors)]
    if len(there) == 0:
        return []
    count = max(int(len(there) * between / BLOCK), 1)
    return np.array_split(there, count)


def compare(ours: Sequence[Array], theirs: Sequence[Array]) -> Comparison:
    """Compare errors [rad] of a fit with those of a simple model, in the same blocks,
    each of shape (n,).

    An infinite error stands for a simulation that diverged. A fit that diverges is
    worse.
    """
    blocks = len(ours)
    if not all(np.isfinite(block).all() for block in ours):
        return Comparison(outcome=Outcome.WORSE, blocks=blocks)
    if blocks == 0:
        return Comparison(outcome=Outcome.UNTOLD)
    to_deg2 = np.degrees(1.0) ** 2
    differences = list[Array]()
    for our, their in zip(ours, theirs, strict=True):
        differences.append(to_deg2 * (our**2 - their**2))
    count = sum(map(len, differences))
    mean = sum(float(block.sum()) for block in differences) / count
    if blocks < 2:
        return Comparison(outcome=Outcome.UNTOLD, difference_deg2=mean, blocks=blocks)
    # the variance of a ratio of sums over blocks: of differences, to samples
    sums = np.array([np.sum(block - mean) for block in differences])
    variance = blocks / (blocks - 1) * np.sum(sums**2)
    sd = float(np.sqrt(variance) / count)
    quantile = float(student.ppf(ONE_SIDED, blocks - 1))
    outcome = Outcome.UNTOLD
    if blocks >= LEAST_BLOCKS and abs(mean) > quantile * sd:
        outcome = Outcome.BETTER if mean < 0 else Outcome.WORSE
    return Comparison(outcome=outcome, difference_deg2=mean, sd_deg2=sd, blocks=blocks)
