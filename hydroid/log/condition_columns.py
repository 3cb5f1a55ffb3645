"""The columns of a table that seem to be an engine's speed and the oil's temperature."""

from collections.abc import Collection, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from hydroid.arrays import Array, Limits
from hydroid.errors import LogError
from hydroid.files import Plain
from hydroid.log.clues import CLUES, column_unit, joint_of, number_in, words
from hydroid.log.conditions import limits
from hydroid.log.rates import FEWEST
from hydroid.log.repair import MOST_LEFT_OUT
from hydroid.log.table import Signal, Table
from hydroid.settings.log import Input
from hydroid.units import Unit
from hydroid.words import listed

SLOWEST_IN_RPM = 100.0
"""an engine's speed from which a number without a unit is in rpm, below in rev/s"""
MEANINGS: dict[Input, str] = {
    "engine_speed": "the engine's speed",
    "oil_temperature": "the oil's temperature",
}
DIGITS = 4
"""of a reference"""


class ConditionGuess(NamedTuple):
    """What a column seems to hold: the settings of it, none if it cannot be used, and
    why."""

    name: Input
    settings: Plain | None
    reason: str


def guess_conditions(
    tables: Sequence[Table], joints: Sequence[str], used: Collection[str]
) -> Iterator[ConditionGuess]:
    """Yield what the columns of the first table seem to hold besides those that are
    `used`: an engine's speed, and an oil's temperature.

    `joints`: their names, and those of what they move; a column that names one is its
    own speed.
    """
    units = _spare_columns(tables[0], joints, used)
    engines = [name for name, unit in units.items() if _is_engine(name, unit)]
    oils = [name for name, unit in units.items() if _is_oil(name, unit)]
    # of several the one whose name says most
    of_names: tuple[tuple[Input, str], ...] = (
        ("engine_speed", _best(engines, "engine")),
        ("oil_temperature", _best(oils, "oil")),
    )
    for quantity, column in of_names:
        if column:
            unit = units[column]
            yield condition_guess(tables, column, quantity, unit.name if unit else "")


def _spare_columns(
    table: Table, joints: Sequence[str], used: Collection[str]
) -> dict[str, Unit | None]:
    """Return the units of the columns that are neither `used` nor a joint's, by name;
    None of one that states none."""
    units = dict[str, Unit | None]()
    for name in table.names:
        if not name or name in used:
            continue
        if joint_of(name, joints) is None:
            units[name] = column_unit(name, table.units.get(name, ""))
    return units


def _is_engine(name: str, unit: Unit | None) -> bool:
    clues = CLUES["engine"]
    in_name = {*words(name)}
    if not in_name.isdisjoint(clues["not"]):
        return False
    # of several motors each moves a joint
    if number_in(name) is not None and in_name.isdisjoint(clues["one"]):
        return False
    if unit is not None:
        return unit.name in ("rpm", "rev/s")
    return not (in_name.isdisjoint(clues["of"]) or in_name.isdisjoint(clues["is"]))


def _is_oil(name: str, unit: Unit | None) -> bool:
    clues = CLUES["oil"]
    in_name = {*words(name)}
    if in_name.isdisjoint(clues["of"]) or not in_name.isdisjoint(clues["not"]):
        return False
    if unit is not None:
        return unit.quantity == "temperature"
    return not in_name.isdisjoint(clues["is"])


def _best(names: Sequence[str], clue: str) -> str:
    """Return the first of the names with a word of what it is; "" where there is no
    name."""
    said = [name for name in names if not {*words(name)}.isdisjoint(CLUES[clue]["of"])]
    return next(iter([*said, *names]), "")


def condition_guess(
    tables: Sequence[Table], column: str, name: Input, unit: str
) -> ConditionGuess:
    """Return the settings of a column that holds a condition in all tables, with the
    median as the reference; none where a table lacks it, or a machine is off.

    `unit`: "" where none is stated.
    """
    about = f"{column}: {MEANINGS[name]}"
    lacking = [table.source for table in tables if column not in table.names]
    if lacking:
        why = f"{listed(lacking, 2)} {'lack' if lacking[1:] else 'lacks'} it"
        return ConditionGuess(name, None, f"{about}, not used, for {why}")
    of_logs = [_values(table, column) for table in tables]
    if not all(map(len, of_logs)):
        why = "too many of its cells hold no number"
        return ConditionGuess(name, None, f"{about}, not used, for {why}")
    values = np.concatenate(of_logs)
    reference = rounded(float(np.median(values)))
    unit = unit or _likely_unit(name, column, reference)
    about += f", {_ends(values, unit)}"
    why = _why_unusable(name, values, limits(name, unit, reference))
    if why:
        return ConditionGuess(name, None, f"{about}, not used, for {why}")
    settings: Plain = {"column": column, "unit": unit, "reference": reference}
    return ConditionGuess(name, settings, about)


def _ends(values: Array, unit: str) -> str:
    """Say from where to where values in a unit go."""
    least = float(values.min())
    most = float(values.max())
    if least == most:
        return f"always {least:.4g} {unit}"
    return f"{least:.4g} to {most:.4g} {unit}"


def _why_unusable(name: Input, values: Array, works_within: Limits) -> str:
    """Say why values are not those of a machine that works; "": they are."""
    low, high = works_within
    is_within = low <= values.min() and values.max() <= high
    if name != "engine_speed":
        return "" if is_within else "no machine works there"
    # the least speed is a part of the median, which is 0 of an engine that is mostly off
    if is_within and low > 0:
        return ""
    if values.max() <= 0:
        return "no machine works there"
    return (
        "it is off at times; to use it, leave these stretches out by log.work, and name "
        f"it in log.{name}"
    )


def _values(table: Table, name: str) -> Array:
    """Return the numbers of a column; none where too many cells hold none."""
    try:
        values = table.read([Signal(name, "condition")]).time
    except LogError:
        # a channel of a single message
        return np.empty(0)
    there = np.isfinite(values)
    steps = np.diff(np.flatnonzero(there))
    # a slower channel has a number in every so many rows; `rates.join_rates` reads it
    is_even = len(steps) >= FEWEST and steps.max() <= 3 * np.median(steps)
    if there.mean() < 1.0 - MOST_LEFT_OUT and not is_even:
        return np.empty(0)
    return values[there]


def _likely_unit(name: Input, column: str, median: float) -> str:
    """Return the unit of a column that states none."""
    if name == "engine_speed":
        return "rpm" if median >= SLOWEST_IN_RPM else "rev/s"
    return "degF" if words(column)[-1] == "f" else "degC"


def rounded(value: float) -> float:
    """Return a reference of few digits."""
    return float(f"{value:.{DIGITS}g}")
