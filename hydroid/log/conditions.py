"""What a machine works under besides commands: the speed of its engine, and the
temperature of its oil, each relative to a reference."""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from hydroid.arrays import Array, Limits
from hydroid.errors import SettingsError
from hydroid.log.log import Log, LogFinding, log_finding
from hydroid.log.table import Recording, Signal, Table
from hydroid.settings.log import EFFECTS, Input, LogSettings
from hydroid.units import UNITS
from hydroid.words import listed

SLOWEST = 0.1
"""part of its reference below which an engine does not run"""
FASTEST = 10.0
"""times its reference that no engine reaches"""
COLDEST = {"degC": -60.0, "degF": -76.0}
HOTTEST = {"degC": 200.0, "degF": 392.0}
LEAST_SPAN = {"engine_speed": 0.05, "oil_temperature": 3.0}
"""between the ends of what logs hold, from which an effect can be told: part of the
reference, and K"""
NEITHER = (1.0, 0.0)
"""what stands for an engine's speed and an oil's temperature that nobody has logged"""


def words_of(name: Input) -> str:
    """Return what messages call it."""
    return name.replace("_", " ")


def condition_signals(settings: LogSettings) -> Iterator[Signal]:
    """Yield the signals of the columns that settings name."""
    for name in EFFECTS:
        column = settings.condition(name)
        if column is None:
            continue
        factor = UNITS[column.unit.lower()].factor
        low, high = limits(name, column.unit, column.reference)
        yield Signal(
            name=column.column,
            kind=words_of(name),
            owner=words_of(name),
            gain=column.scale * factor,
            offset=column.offset * factor,
            low=low * factor,
            high=high * factor,
            unit=column.unit,
            setting=f"log.{name}",
            reference=column.reference * factor,
        )


def limits(name: Input, unit: str, reference: float) -> Limits:
    """Return the least and the largest value of a machine that works, in a unit."""
    if name == "engine_speed":
        return SLOWEST * reference, FASTEST * reference
    return COLDEST[unit], HOTTEST[unit]


def is_condition(signal: Signal) -> bool:
    """Return whether a signal is one of what a machine works under."""
    return signal.kind in map(words_of, EFFECTS)


def only_present(
    table: Table, signals: Sequence[Signal], findings: list[LogFinding]
) -> list[Signal]:
    """Return signals without the conditions that a file of commands lacks: they are at
    their references then, and a finding says so."""
    present = list[Signal]()
    for signal in signals:
        if signal.name in table.names or not is_condition(signal):
            present.append(signal)
            continue
        stated = f"{signal.reference / UNITS[signal.unit.lower()].factor:.6g}"
        findings.append(
            log_finding(
                "note",
                "at the reference",
                table.source,
                signal.kind,
                missing=signal.name,
                reference=stated,
                unit=signal.unit,
            )
        )
    return present


def relative(recording: Recording, grid: Array, time: Array) -> Array | None:
    """Return the conditions of a recording at times of a grid, (T, 2), as `Log` has
    them; `time` is that of its rows. None: it has neither column."""
    conditions = np.tile(NEITHER, (len(grid), 1))
    found = False
    columns = recording.values.T
    for signal, values in zip(recording.signals, columns, strict=True):
        if not is_condition(signal):
            continue
        found = True
        there = np.interp(grid, time, values)
        # equal values give 1 and 0 to the bit
        if signal.kind == words_of("engine_speed"):
            conditions[:, 0] = there / signal.reference
        else:
            conditions[:, 1] = there - signal.reference
    return conditions if found else None


def absolute(signal: Signal, log: Log) -> Array:
    """Return what a column holds in SI, (T,): the conditions of a log with the reference
    of their signal."""
    assert log.conditions is not None
    if signal.kind == words_of("engine_speed"):
        return log.conditions[:, 0] * signal.reference
    return log.conditions[:, 1] + signal.reference


def stated(log: Log, settings: LogSettings, name: Input) -> Array | None:
    """Return an engine's speed or an oil's temperature in the unit of the settings,
    (T,); None: they have no column of it."""
    column = settings.condition(name)
    if column is None or log.conditions is None:
        return None
    if name == "engine_speed":
        return log.conditions[:, 0] * column.reference
    factor = UNITS[column.unit.lower()].factor
    return log.conditions[:, 1] / factor + column.reference


def relative_to(
    settings: LogSettings, values: Mapping[str, float]
) -> tuple[float, float]:
    """Return an engine's speed over its reference, and how much warmer oil is than at
    its own [K], of values in the units of the settings.

    Raises SettingsError: the settings have no such column, or no machine works so.
    """
    conditions = [*NEITHER]
    for place, name in enumerate(EFFECTS):
        value = values.get(name)
        column = settings.condition(name)
        if value is None:
            continue
        if column is None:
            hint = f"the fit's logs have no column log.{name}"
            raise SettingsError("no effect of it is known", name, hint)
        low, high = limits(name, column.unit, column.reference)
        if not low <= value <= high:
            what = f"{value:.6g} {column.unit} is not from {low:.6g} to {high:.6g}"
            raise SettingsError(what, name)
        factor = UNITS[column.unit.lower()].factor
        conditions[place] = value / column.reference
        if name == "oil_temperature":
            conditions[place] = (value - column.reference) * factor
    if stray := values.keys() - EFFECTS.keys():
        hint = f"choose {listed([*EFFECTS])}"
        raise SettingsError(f"no {listed(sorted(stray))}", "conditions", hint)
    engine, warmer = conditions
    return engine, warmer


def at_references(settings: LogSettings) -> str:
    """Say under which conditions a machine works of which nothing else is said; "" where
    the settings have no column of any."""
    known = list[str]()
    for name in EFFECTS:
        column = settings.condition(name)
        if column is not None:
            known.append(f"{words_of(name)} {column.reference:.6g} {column.unit}")
    if not known:
        return ""
    return f"The machine is as at the references: {listed(known)}."


def varies(logs: Sequence[Log], name: Input) -> bool:
    """Return whether logs hold enough of a condition to tell its effect."""
    place = [*EFFECTS].index(name)
    held = [log.conditions[:, place] for log in logs if log.conditions is not None]
    if not held:
        return False
    return bool(np.ptp(np.concatenate(held)) >= LEAST_SPAN[name])
