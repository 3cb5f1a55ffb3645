"""The words of every finding, one row a kind; and how lists and numbers are written.

A sentence is a format string. It may use the finding's numbers by name (`{rms:.2g}`; without a format, four
digits) and its subjects: `{0}` is the first, `{names}` all of them, `{few}` the first few and how many more
there are. `{is}`, `{has}`, `{s}`, `{it}` and `{its}` agree with the number of subjects.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from hydroid.findings import Finding

MOST_NAMES = 4
"""names that `{few}` gives"""


@dataclass(frozen=True)
class Words:
    """What a kind of finding states, and what to do about it; a hint may be empty."""

    statement: str
    hint: str = ""


WORDS: dict[str, Words] = {
    # a fit
    "not refined": Words(
        "The estimate comes from the search alone and need not be an optimum.",
        "Fit again without --no-refinement.",
    ),
    "not converged": Words(
        "The refinement '{0}' did not converge: {ending}. Do not trust the estimate or its intervals.",
        "Allow more iterations (refinement.iterations), or try another seed.",
    ),
    "diverged": Words("The simulation of the estimate '{0}' diverged. It is not used."),
    "norm raised": Words(
        "The refinement lowered the rms error but raised the {norm}, which the search minimised."
    ),
    "at zero": Words("{names} {is} 0, the least possible value: the logs show no such effect."),
    "at bound": Words(
        "{names} {is} at the {side} bound. The error would fall further beyond it.",
        "Widen the bound if such values are possible. Otherwise the model lacks something.",
    ),
    "strained prior": Words(
        "The estimate is {score:.1f} standard deviations {side} its prior of {0}.",
        "Either the prior is wrong, or the parameter makes up for an error of the model.",
    ),
    "logs disagree": Words(
        "The model errs differently in each log, so the 95 % intervals of {few} are too narrow.",
        "Use the intervals by log.",
    ),
    "few logs disagree": Words(
        "The logs disagree about {few} by more than the noise explains.",
        "Add logs before you use these values: so few cannot tell why.",
    ),
}


def statement(finding: Finding) -> str:
    """Return what a finding says."""
    return _filled(WORDS[finding.kind].statement, finding)


def hint(finding: Finding) -> str:
    """Return what to do about a finding; empty where nothing is to be done."""
    return _filled(WORDS[finding.kind].hint, finding)


def sentence(finding: Finding) -> str:
    """Return statement and hint of a finding."""
    return f"{statement(finding)} {hint(finding)}".strip()


def listed(names: Sequence[str], most: int | None = None) -> str:
    """Join names as in a sentence; of more than `most` only the first, and how many more there are."""
    if most is not None and len(names) > most + 1:
        return f"{', '.join(names[:most])} and {len(names) - most} more"
    *first, last = names or ("",)
    return f"{', '.join(first)} and {last}" if first else last


def number(value: float) -> str:
    """Write four significant digits, without exponent from 0.0001 to ten million; a dash if not finite."""
    if not math.isfinite(value):
        return "–"
    if value == 0:
        return "0"
    scientific = f"{value:.3e}"
    exponent = int(scientific.partition("e")[2])  # of the rounded value: 0.99999 is 1.000, not 1.0000
    return f"{float(scientific):.{max(0, 3 - exponent)}f}" if -4 <= exponent < 7 else scientific


def plain(value: float) -> str:
    """Write at most six significant digits, without trailing zeros."""
    if not math.isfinite(value):
        return "–"
    text = f"{value:.6g}"
    return f"{float(text):.0f}" if "e+" in text and abs(value) < 1e9 else text


class _Number(float):
    def __format__(self, spec: str) -> str:
        return super().__format__(spec) if spec else number(self)


def _filled(words: str, finding: Finding) -> str:
    names, one = finding.subjects, len(finding.subjects) == 1
    grammar = {"is": "is", "has": "has", "s": "", "it": "it", "its": "its"}
    if not one:
        grammar = {"is": "are", "has": "have", "s": "s", "it": "they", "its": "their"}
    numbers = {
        key: value if isinstance(value, str) else _Number(value) for key, value in finding.numbers.items()
    }
    lists = {"names": listed(names), "few": listed(names, MOST_NAMES)}
    return words.format(*names, **grammar, **lists, **numbers)
