"""Tests of claims: over the same seeds, does one cell have a lower measure than another?

Differences are paired by seed and tested by Wilcoxon's signed-rank test, two-sided. The p-values of all
claims of a study are corrected together by Holm's method. The effect size is the matched-pairs rank-biserial
correlation: 1 if the claim holds on every seed, -1 if its opposite does.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Any

import numpy as np
from scipy.stats import rankdata, wilcoxon
from studies import Claim

from hydroid.parameters import Array
from hydroid.studies.study import Row

SIGNIFICANT = 0.05


class Outcome(Enum):
    """What the runs say of a claim."""

    CONFIRMED = "confirmed"
    OPEN = "not confirmed"
    CONTRADICTED = "contradicted"
    UNTESTED = "not tested"


@dataclass(frozen=True)
class Verdict:
    """A statement and what was found of it.

    Attributes:
        says: the statement.
        outcome: the answer.
        detail: what it rests on, in words.
        item: the article's table or figure that makes the statement; empty where none does.
        ours: the statement is not the article's.
        p: of a claim, corrected by Holm's method; nan where nothing was tested.
        effect: of a claim: rank-biserial correlation, from -1 to 1; nan where nothing was tested.
    """

    says: str
    outcome: Outcome
    detail: str
    item: str = ""
    ours: bool = False
    p: float = np.nan
    effect: float = np.nan

    @property
    def sentence(self) -> str:
        """The verdict in a sentence."""
        return f"{self.says}: {self.outcome.value} ({self.detail})."


def verdicts(claims: Sequence[Claim], rows: Sequence[Row]) -> list[Verdict]:
    """Return the verdict on every claim, with p-values corrected over all of them.

    Where even a difference on every seed would not be significant after the correction, none is tested.
    """
    pairs = [_pairs(claim, rows) for claim in claims]
    least = np.array([2.0 ** (1 - len(p)) if len(p) else 1.0 for p in pairs])
    able = least < SIGNIFICANT
    family = int(able.sum())
    able &= least.min(initial=1.0) * family < SIGNIFICANT
    raw = [
        signed_rank(p[:, 1] - p[:, 0]) if tested else (np.nan, np.nan)
        for p, tested in zip(pairs, able, strict=True)
    ]
    corrected = holm(np.array([p for p, _ in raw])).tolist()
    found = zip(claims, pairs, corrected, raw, strict=True)
    return [_verdict(claim, pair, p, effect, family) for claim, pair, p, (_, effect) in found]


def _pairs(claim: Claim, rows: Sequence[Row]) -> Array:
    """Return the measure of both cells on the seeds that both have, shape (n, 2)."""
    lower, than = (
        {row.seed: row.values[claim.column] for row in rows if row.cell == cell and not row.failed}
        for cell in (claim.lower, claim.than)
    )
    pairs = np.array([(lower[seed], than[seed]) for seed in lower if seed in than], float).reshape(-1, 2)
    return pairs[np.isfinite(pairs).all(axis=1)]


def _verdict(claim: Claim, pairs: Array, p: float, effect: float, family: int) -> Verdict:
    seeds = f"{len(pairs)} seed{'s' * (len(pairs) != 1)}"
    if not np.isfinite(p):
        few = f"{seeds} are too few for {f'{family} claims' if family else 'any answer'}"
        return Verdict(claim.says, Outcome.UNTESTED, claim.untested or few, claim.item, claim.ours)
    low, high = np.median(pairs, axis=0).tolist()
    detail = f"median {claim.column} {low:.3g} against {high:.3g}; p = {p:.2g}, effect {effect:+.2f}, {seeds}"
    if np.array_equal(pairs[:, 0], pairs[:, 1]):
        detail = f"{claim.column} is the same in both, seed by seed; median {low:.3g}, {seeds}"
    outcome = Outcome.CONFIRMED if effect > 0 else Outcome.CONTRADICTED
    outcome = outcome if p < SIGNIFICANT else Outcome.OPEN
    return Verdict(claim.says, outcome, detail, claim.item, claim.ours, p, effect)


def signed_rank(difference: Array) -> tuple[float, float]:
    """Return Wilcoxon's two-sided p-value and the rank-biserial correlation of differences, shape (n,).

    Equal pairs are left out, as Wilcoxon did; if all are equal, p is 1 and the effect 0.
    """
    changed = difference[difference != 0]
    if not changed.size:
        return 1.0, 0.0
    ranks = rankdata(np.abs(changed))
    test: Any = wilcoxon(changed)  # the stubs leave its type open
    return float(test.pvalue), float(np.sum(np.sign(changed) * ranks) / ranks.sum())


def holm(p: Array) -> Array:
    """Return p-values corrected by Holm's step-down method, shape (n,); nan stays and does not count."""
    corrected, known = np.full(len(p), np.nan), np.flatnonzero(np.isfinite(p))
    order = known[np.argsort(p[known], kind="stable")]
    corrected[order] = np.minimum(1.0, np.maximum.accumulate(p[order] * np.arange(len(order), 0, -1)))
    return corrected
