"""The words of every finding, one row a kind; and how lists and numbers are written.

A sentence is a format string. It may use the finding's numbers by name (`{rms:.2g}`; without a format, four
digits) and its subjects: `{0}` is the first, `{names}` all of them, `{few}` the first few and how many more
there are. `{is}`, `{has}`, `{s}`, `{it}`, `{them}` and `{its}` agree with the number of subjects.
"""

import math
from collections.abc import Mapping, Sequence

from hydroid.log_words import LOG_WORDS

_BRINGS = "{what} would be known to {after} % instead of {before} %."

WORDS: dict[str, tuple[str, str]] = LOG_WORDS | {
    # a fit
    "not refined": (
        "The estimate comes from the search alone and need not be an optimum.",
        "Fit again without --no-refinement.",
    ),
    "not converged": (
        "The refinement '{0}' did not converge: {ending}. Do not trust the estimate or its intervals.",
        "Allow more iterations (refinement.iterations), or try another seed.",
    ),
    "diverged": ("The simulation of the estimate '{0}' diverged. It is not used.", ""),
    "at zero": ("{names} {is} 0, the least possible value: the logs show no such effect.", ""),
    "at bound": (
        "{names} {is} at the {side} bound. The error would fall further beyond it.",
        "Widen the bound if such values are possible. Otherwise the model lacks something.",
    ),
    "strained prior": (
        "The estimate is {score:.1f} standard deviations {side} its prior of {0}.",
        "Either the prior is wrong, or the parameter makes up for an error of the model.",
    ),
    "logs disagree": (
        "The model errs differently in each log, so the 95 % intervals of {few} are too narrow.",
        "Use the intervals by log.",
    ),
    "no effect": (
        "{few} {has} no effect on the compared angles.",
        "Hold {them} fixed, or compare another joint.",
    ),
    "not identifiable": (
        "The logs do not determine {few}.",
        "State priors, compare more joints, or add logs in other poses.",
    ),
    "prior only": ("The logs add next to nothing to the prior{s} of {few}.", ""),
    "weakly identifiable": ("{few} {is} known to 30 to 100 % only.", ""),
    "effect unknown": ("The simulation diverges when {few} {is} changed: {its} effect is unknown.", ""),
    "combination": (
        "{few} cannot be told apart: certain changes of them together give nearly the same motion.",
        "",
    ),
    "more combinations": ("{count} more combinations are open: see Directions.", ""),
    "quantities open": ("The logs do not determine these quantities: {few}.", ""),
    # advice: the statement says what to do, the hint what it would bring
    "nothing missing": (
        "Tested: {count} quantities that the fit holds. Freeing none of them would lower the error on data "
        "left out.",
        "",
    ),
    "look for terms": (
        "Find what the model lacks, and what to measure next.",
        "`suggest` tries the most promising terms and prints the command for the best.",
    ),
    "term missing": (
        "Free {0}: the rms error on parts of the logs left out falls from {error}° to {freed}°.",
        "Keep it if the error on an unseen log falls too.",
    ),
    "more terms missing": (
        "{few} would also lower the error, but may describe the same error.",
        "Free one at a time, and validate each new fit.",
    ),
    "weigh": ("Weigh {0} to ±{sd:.0f} %.", _BRINGS),
    "state": ("State {0} to ±{sd:.0f} %, from a data sheet or a measurement.", _BRINGS),
    "experiment": ("Run the designed experiment of {0} s (`hydroid design`).", _BRINGS),
    "fit the hydraulics": ("Fit the hydraulics.", "A gain replaces them here: most of the error is theirs."),
    "predict unseen": ("Predict a log that this fit has not seen.", "Only such a log can test the model."),
    "run the experiment": (
        "Run commands.csv on the machine.",
        "The limits were checked only in simulation, at the present estimate; the machine moves differently "
        "as far as it differs from the model. Watch the first run with a hand on the emergency stop.",
    ),
    # a profile
    "better optimum": (
        "The profile{s} of {few} found a better fit than the estimate, which is no optimum.",
        "Fit again from there, with more iterations or another seed.",
    ),
    # a residual
    "residual depends": (
        "{0}: the measured angle is {error:.2g}° {side} than the simulated one where the {1} is {low} to "
        "{high} {unit}.",
        "",
    ),
    "residual correlated": (
        "{0}: the error keeps its sign for {seconds:.2g} s.",
        "No sensor is that slow: the model errs.",
    ),
    "few logs disagree": (
        "The logs disagree about {few} by more than the noise explains.",
        "Add logs before you use these values: so few cannot tell why.",
    ),
}
"""statement and hint by kind; a hint may be empty"""


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


def filled(words: str, names: Sequence[str], numbers: Mapping[str, float | str]) -> str:
    """Return a sentence of WORDS with a finding's subjects and numbers."""
    one, many = ("is", "has", "", "it", "it", "its"), ("are", "have", "s", "they", "them", "their")
    grammar = dict(
        zip(("is", "has", "s", "it", "them", "its"), one if len(names) == 1 else many, strict=True)
    )
    shown = {key: value if isinstance(value, str) else _Number(value) for key, value in numbers.items()}
    return words.format(*names, **grammar, **shown, names=listed(names), few=listed(names, 4))
