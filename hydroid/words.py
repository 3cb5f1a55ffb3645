"""How sentences, lists and numbers are written."""

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from itertools import count
from unicodedata import category

NARROW = 0.5
"""part of a value up to which half of its interval stands behind it, as in "42 ± 3"
"""


def listed(names: Sequence[str], most: int | None = None) -> str:
    """Join names as in a sentence; of more than `most` only the first, and how many
    more there are."""
    if most is not None and len(names) > most + 1:
        return f"{', '.join(names[:most])} and {len(names) - most} more"
    *first, last = names or ("",)
    return f"{', '.join(first)} and {last}" if first else last


def distinct(name: str, taken: set[str], ending: str = "_{}") -> str:
    """Return a name that is not taken, whatever its case, numbered where it must be;
    from now on it is."""
    free = name
    numbers = count(2)
    # files of two names that differ in their case alone are one on some systems
    while free.lower() in taken:
        free = name + ending.format(next(numbers))
    taken.add(free.lower())
    return free


def numbered(names: Iterable[str]) -> list[str]:
    """Return names for readers, all different."""
    taken = set[str]()
    return [distinct(name, taken, " ({})") for name in names]


def printable(text: str) -> str:
    """Replace what would act on a terminal instead of being shown: a file may be called
    by such letters."""
    return "".join(map(_harmless, text))


def _harmless(letter: str) -> str:
    if category(letter) in _ACTING and letter not in "\n\t":
        return "?"
    return letter


_ACTING = ("Cc", "Cf", "Cs")  # controls, marks of direction, and halves of letters


def with_minus(text: str) -> str:
    """Return a text for readers, with a minus sign before each negative number in place
    of a hyphen.

    A hyphen within a word or an option, or between two numbers, stays.
    """
    return _NEGATIVE.sub("−", text)


_NEGATIVE = re.compile(r"(?<![^\s(\[])-(?=\.?\d)")
"""the hyphen of a negative number"""


def number(value: float) -> str:
    """Write four significant digits, without exponent from 0.0001 to ten million; a
    dash if not finite."""
    if not math.isfinite(value):
        return "–"
    if value == 0:
        return "0"
    scientific = f"{value:.3e}"
    # of the rounded value: 0.99999 is 1.000, not 1.0000
    exponent = int(scientific.partition("e")[2])
    if not -4 <= exponent < 7:
        return scientific
    decimals = max(0, 3 - exponent)
    return f"{float(scientific):.{decimals}f}"


def two_digits(value: float) -> str:
    """Write two significant digits, or all before the point."""
    return f"{value:.0f}" if abs(value) >= 100 else f"{value:.2g}"


def three_digits(value: float) -> str:
    """Write three significant digits, or all before the point up to ten million; a dash
    if not finite."""
    if not math.isfinite(value):
        return "–"
    return f"{value:.0f}" if 100 <= abs(value) < 1e7 else f"{value:.3g}"


def interval_words(low: float | None, high: float | None) -> str:
    """Write an interval by two digits of its width, and of each end; nothing where it
    has no limit."""
    if low is None and high is None:
        return ""
    if low is None:
        return f"up to {three_digits(high or 0.0)}"
    if high is None:
        return f"from {three_digits(low)}"
    of_width = _decimals(high - low)
    first = f"{low:.{max(of_width, _decimals(low))}f}"
    last = f"{high:.{max(of_width, _decimals(high))}f}"
    return f"{first} to {last}"


def value_words(value: float, low: float | None, high: float | None) -> str:
    """Write a value with three significant digits, or as many as tell it from both ends
    of its interval."""
    rough = three_digits(value)
    if low is None or high is None or not math.isfinite(value):
        return rough
    of_width = _decimals(high - low)
    if of_width > len(rough.partition(".")[2]):
        return f"{value:.{of_width}f}"
    return rough


def value_and_interval(value: float, low: float | None, high: float | None) -> str:
    """Write a value with its interval in short, as "42 ± 3", or with both ends, as
    "54 (24 to 121)", where these are farther away than NARROW or have no limit."""
    if low is None or high is None:
        ends = interval_words(low, high) or "no interval"
        return f"{two_digits(value)} ({ends})"
    half = max(high - value, value - low)
    if half > NARROW * abs(value):
        return f"{two_digits(value)} ({interval_words(low, high)})"
    # one digit, and two of a half that begins with 1
    decimals = max(0, _decimals(half) - (f"{half:e}"[0] != "1"))
    return f"{value:.{decimals}f} ± {half:.{decimals}f}"


def time_words(seconds: float) -> str:
    """Write how long something took, with the unit that suits: "40 s", "14 min", "2.3
    h"."""
    if seconds < 100:
        return f"{seconds:.0f} s"
    if seconds < 6000:
        return f"{seconds / 60:.0f} min"
    return f"{seconds / 3600:.1f} h"


def _decimals(size: float) -> int:
    """Return how many decimals show two digits of a number; 0 of one from 10 on, and of
    0."""
    return max(0, 1 - math.floor(math.log10(abs(size)))) if size else 0


def told_apart(first: float, second: float) -> tuple[str, str]:
    """Write two numbers beside each other: two significant digits, three where two
    would tie."""
    for digits in (2, 3):
        pair = (significant(first, digits), significant(second, digits))
        if pair[0] != pair[1]:
            break
    return pair


def significant(value: float, digits: int) -> str:
    """Write significant digits, zeros among them, or all before the point."""
    if abs(value) >= 10**digits:
        return f"{value:.0f}"
    return f"{value:#.{digits}g}".rstrip(".")


def plain(value: float) -> str:
    """Write at most six significant digits, without trailing zeros."""
    if not math.isfinite(value):
        return "–"
    text = f"{value:.6g}"
    # a large number of few digits reads more easily without its exponent
    if "e+" in text and abs(value) < 1e9:
        return f"{float(text):.0f}"
    return text


class _Number(float):
    def __format__(self, spec: str) -> str:
        return super().__format__(spec) if spec else number(self)


_ONE = {
    "is": "is",
    "has": "has",
    "do": "does",
    "s": "",
    "it": "it",
    "them": "it",
    "its": "its",
}
_MANY = {
    "is": "are",
    "has": "have",
    "do": "do",
    "s": "s",
    "it": "they",
    "them": "them",
    "its": "their",
}


def filled(words: str, names: Sequence[str], numbers: Mapping[str, float | str]) -> str:
    """Return a sentence of WORDS with a finding's subjects and numbers; numbers by key
    stand in braces."""
    shown = {
        key: value if isinstance(value, str) else _Number(value)
        for key, value in numbers.items()
    }
    grammar = _ONE if len(names) == 1 else _MANY
    lists = {"names": listed(names), "few": listed(names, 4)}
    return words.format(*names, **(shown | grammar | lists))
