"""A table of unknown columns -> a `log` section that maps them, with a reason for each
guess.

The unit of a column, or else the words of its name, tell what it is; without either,
the bare name of a joint or of what a command moves is its angle's. Its joint is the one
whose name or number its own name holds. Where no column of a kind has a joint they are
given to the joints in order; beside columns that have one, a column without is left out
and named.
"""

from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from typing import Any, NamedTuple

import numpy as np

from hydroid.arrays import Array
from hydroid.errors import LogError
from hydroid.files import Plain
from hydroid.log.clues import (
    CLUES,
    RAW,
    column_unit,
    direction,
    joint_of,
    kind_of,
    number_in,
    words,
)
from hydroid.log.rods import Rod
from hydroid.log.signals import CommandRange, likely_range, resting_range
from hydroid.log.table import Signal, Table
from hydroid.units import UNITS, likely_time_unit, unit_of
from hydroid.words import listed

# [s], of which a guess takes the nearest
PERIODS = (0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2)

LENGTHS = ("m", "cm", "mm")
ANGLES = ("rad", "deg")
NO_RODS: Mapping[int, Rod] = {}
NO_RANGES: Mapping[int, tuple[float, float]] = {}
LARGEST_ANGLE = np.radians(400.0)
"""of an arm's joint [rad]; larger numbers are lengths or counts"""
USELESS = "left out, lengths of cylinders whose pivots are not known"
NEEDED = "give both of each in arm.yaml, and lengths stand for angles"


class ColumnGuess(NamedTuple):
    """What the columns of a log seem to hold: the `log` section of a fit's settings,
    and the unused columns.

    A reason stands for each column that it uses, for what is uncertain, and for the
    others.
    """

    log: Plain
    reasons: tuple[str, ...]
    unused: tuple[str, ...]


class _Column(NamedTuple):
    name: str
    kind: str
    unit: str
    values: Array


_Pairs = dict[int, tuple[list[_Column], str]]
"""the column, or the two for the directions of a command, of each joint, and what says
that they are its"""


def guess_columns(
    table: Table,
    joints: Sequence[str],
    *,
    links: Sequence[str] = (),
    slides: Sequence[int] = (),
    rods: Mapping[int, Rod] = NO_RODS,
    ranges: Mapping[int, tuple[float, float]] = NO_RANGES,
) -> ColumnGuess:
    """Guess which columns are time, commands and angles, of which joints, in which
    units.

    Columns may have the names of the links that the joints move instead; positions of
    joints (from 1) that slide are in m. Lengths of the cylinders of joints, `rods`,
    stand for their angles. Counts of an encoder or a converter are taken for the
    `ranges` of the joints [rad].
    """
    columns = [*_columns(table, (*joints, *links))]
    time = max(
        (c for c in columns if c.kind == "time"),
        key=lambda c: _rises(c.values),
        default=None,
    )
    if time is None:
        hint = f"it has {listed([*filter(None, table.names)], 6)}"
        raise LogError("has no column that looks like a time", table.source, hint)
    step = np.nanmedian(np.diff(time.values))
    unit = time.unit or likely_time_unit(step) or "s"
    step *= UNITS[unit].factor
    reasons = [f"{time.name}: time in {unit}, every {step:.3g} s"]
    commands, angles = (
        _by_joint(
            _angles_first(columns, kind), (joints, links), (slides, rods), reasons
        )
        for kind in ("command", "angle")
    )
    unitless = list[Array]()
    for joint, ((column,), _) in angles.items():
        if joint not in slides and not column.unit and not _is_raw(column):
            unitless.append(column.values)
    default = (
        "rad"
        if max((np.nanmax(np.abs(x)) for x in unitless), default=np.inf) <= 6.3
        else "deg"
    )
    given = {joint: _cells(table, pair) for joint, (pair, _) in commands.items()}
    usual = _usual_range([*given.values()])
    entries = dict[int, Plain]()
    for joint in sorted({*angles, *commands}):
        entry: Plain = {"command": None, "angle": None}
        entries[joint], of = entry, joints[joint - 1]
        if joint in commands:
            pair, why = commands[joint]
            entry["command"], said = _command(pair, given[joint], usual)
            reasons.append(f"{said} of {of}, {why}")
        if joint in angles:
            (column,), why = angles[joint]
            slide = joint in slides
            entry["angle"], said = _angle(
                column,
                default,
                slides=slide,
                rod=rods.get(joint),
                limits=ranges.get(joint),
            )
            reasons.append(f"{said} of {of}, {why}")
    for column in columns:
        if column.kind == "target":
            reasons.append(
                f"{column.name}: a target of a position, no valve's opening; a controller lies between"
            )
    used = {time.name} | {
        c.name
        for pairs in (commands, angles)
        for pair, _ in pairs.values()
        for c in pair
    }
    log: Plain = {
        "time": {"column": time.name, "unit": unit},
        "command": None,
        "angle": None,
        "period_s": nearest_period(step),
        "joints": entries,
    }
    unused = tuple(name for name in table.names if name and name not in used)
    reasons += [f"not used: {listed(unused)}"] if unused else []
    return ColumnGuess(log, tuple(reasons), unused)


def _angle(
    column: _Column,
    usual: str,
    *,
    slides: bool,
    rod: Rod | None,
    limits: tuple[float, float] | None,
) -> tuple[Plain, str]:
    """Return the settings of the column of a joint's angle, and what it is taken
    for."""
    largest = float(np.nanmax(np.abs(column.values)))
    raw = _is_raw(column)
    if slides and not raw:  # no telescope is 50 m long
        unit = column.unit or ("mm" if largest > 50 else "m")
        return {
            "column": column.name,
            "unit": unit,
        }, f"{column.name}: position in {unit}"
    if rod is not None and raw and _is_length(column):
        ends = 1e3 * rod.ends[0], 1e3 * rod.ends[1]
        return _over_the_range(column, ends, "mm", "stroke of its cylinder")
    if length := _length(column, rod, usual):
        unit, offset = length
        entry: Plain = {"column": column.name, "unit": unit}
        if not offset:
            return entry, f"{column.name}: length of the cylinder in {unit}"
        with_it_in = f"whose cylinder is {offset:.6g} {unit} long with it in,"
        said = f"{column.name}: travel of the rod in {unit}, {with_it_in}"
        return entry | {"offset": offset}, said
    too_large = not column.unit and largest * UNITS[usual].factor > LARGEST_ANGLE
    if limits and (raw or too_large):
        ends = (
            limits
            if slides
            else (float(np.degrees(limits[0])), float(np.degrees(limits[1])))
        )
        return _over_the_range(column, ends, "m" if slides else "deg", "range")
    unit = usual if raw else column.unit or usual
    return {"column": column.name, "unit": unit}, f"{column.name}: angle in {unit}"


def _is_raw(column: _Column) -> bool:
    """Return whether a position is as a sensor gives it: in V, mA or counts."""
    if column.unit:
        return UNITS[column.unit.lower()].quantity in RAW
    return not {*words(column.name)}.isdisjoint(CLUES["counts"])


def _over_the_range(
    column: _Column, ends: tuple[float, float], unit: str, whole: str
) -> tuple[Plain, str]:
    """Return the settings of a position in V, mA or counts, which is taken for all that
    a joint can do.

    `ends` of that are in the unit.
    """
    known = column.values[np.isfinite(column.values)]
    low, high = float(known.min()), float(known.max())
    least, most = ends
    span = high - low or 1.0
    scale = float(f"{(most - least) / span:.6g}")
    offset = float(f"{least - scale * low:.6g}")
    signal = column.unit or "counts"
    what = f"{low:g} to {high:g} {signal}, taken for the whole {whole}, {least:.4g} to {most:.4g} {unit}"
    hint = "correct scale and offset where the log does not reach both ends,"
    entry: Plain = {
        "column": column.name,
        "unit": unit,
        "scale": scale,
        "offset": offset,
    }
    return entry, f"{column.name}: {what}: {hint}"


def _angles_first(columns: Sequence[_Column], kind: str) -> list[_Column]:
    """Return the columns of a kind; lengths last, for a joint whose angle is there
    needs none."""
    return sorted((c for c in columns if c.kind == kind), key=_is_length)


def _is_length(column: _Column) -> bool:
    if column.unit in LENGTHS:
        return True
    named = {*words(column.name)}
    turns = column.unit in ANGLES or not named.isdisjoint(CLUES["turns"])
    return not turns and not named.isdisjoint(CLUES["lengths"])


def _length(column: _Column, rod: Rod | None, unit: str) -> tuple[str, float] | None:
    """Return unit and offset of a column that holds the length of a joint's cylinder;
    None: it does not.

    A column without a unit holds angles if its name does not say otherwise and they are
    in a joint's reach.
    """
    if rod is None or (column.unit and column.unit not in LENGTHS):
        return None
    angles = np.nanmax(np.abs(column.values)) * UNITS[unit].factor <= LARGEST_ANGLE
    if not _is_length(column) and angles:
        return None
    read = rod.reading(column.values, column.unit)
    if read is None and _is_length(column):
        # lengths that its cylinder cannot have: who reads them says which
        return column.unit or rod.nearest_unit(column.values), 0.0
    return read


def nearest_period(step: float) -> float:
    """Return the usual period that is most like a log's [s]."""
    return min(PERIODS, key=lambda p: max(p, step) / max(min(p, step), 1e-9))


def _columns(table: Table, names: Sequence[str]) -> Iterator[_Column]:
    """Yield the columns that seem to be times, commands or angles; arrays of a rare
    length are no signals."""
    units = {
        name: column_unit(name, table.units.get(name, ""))
        for name in table.names
        if name
    }
    of_joints = {word for name in names for word in words(name)} - {"joint", "link"}
    every = {name: kind_of(name, unit) for name, unit in units.items()}
    bare = [{*words(name)} - {"joint"} for name in names]
    bare += [
        {*words(name)} - {*CLUES["kinds"]["command"]}
        for name, kind in every.items()
        if kind == "command"
    ]
    kinds = {name: kind for name, kind in every.items() if kind != "other"}
    kinds |= {
        name: "angle"
        for name in every
        if name not in kinds and {*words(name)} - {"joint"} in bare
    }
    lengths = [len(table.columns.get(name, ())) for name in kinds]  # 0 in a bag
    for (name, kind), length in zip(kinds.items(), lengths, strict=True):
        if length == max(lengths, key=lengths.count):
            with suppress(LogError):  # a channel of a single message
                recording = table.read([Signal(name, kind)])
                values = recording.time
                unit = units[name]
                stated = unit.name if unit else ""
                if kind == "time" and not _rises(values):
                    pulses = likely_range(values, unit=stated)
                    measured = not {*words(name)}.isdisjoint(of_joints)
                    # "Boom Ms" may be its measured position
                    kind = (
                        "command"
                        if pulses and _are_pulses(pulses)
                        else "angle"
                        if measured
                        else kind
                    )
                    stated = "" if kind == "angle" else stated
                if np.isfinite(values).any():
                    yield _Column(name, kind, stated, values)


def _are_pulses(likely: CommandRange) -> bool:
    unit = unit_of(likely.name.split()[-1])
    return unit is not None and unit.quantity == "time"


def _rises(values: Array) -> bool:
    steps = np.diff(values[np.isfinite(values)])
    if not len(steps):
        return False
    return bool(np.mean(steps > 0) > 0.99 and np.median(steps) > 0.5 * steps.mean())


def _by_joint(
    columns: Sequence[_Column],
    known: tuple[Sequence[str], Sequence[str]],
    lengths: tuple[Collection[int], Collection[int]],
    reasons: list[str],
) -> _Pairs:
    """Give columns of one kind to the joints; say what is uncertain or left out.

    `lengths`: joints that slide, and those that a cylinder turns.
    """
    slides, rods = lengths
    groups, given, names = dict[Any, list[_Column]](), _Pairs(), known[0]
    kind = columns[0].kind if columns else ""
    for column in columns:
        sign, others = direction(column.name)
        groups.setdefault(
            others if sign and kind == "command" else column.name, []
        ).append(column)
    pairs = [
        sorted(pair, key=lambda c: -direction(c.name)[0])[:2]
        for pair in groups.values()
    ]
    from_zero = any(number_in(column.name) == 0 for column in columns)

    def give(pair: list[_Column], joint: int, why: str) -> bool:
        """Give columns to a joint that has none yet and moves in their unit; return
        whether it does."""
        fits = kind == "command" or _suits(
            pair[0], slides=joint in slides, has_rod=joint in rods
        )
        free = fits and 0 < joint <= len(names) and joint not in given
        if free:
            given[joint] = pair, why
        return free

    def named(name: str) -> tuple[int, str]:
        if joint := next(filter(None, (joint_of(name, of) for of in known)), 0):
            return joint, "by its name"
        number = number_in(name)
        return 0 if number is None else number + from_zero, "by its number"

    left = [pair for pair in pairs if not give(pair, *named(pair[0].name))]
    useless = list[list[_Column]]()
    for pair in left if kind == "angle" else ():
        joint, _ = named(pair[0].name)
        if _is_length(pair[0]) and joint and joint not in given:
            useless.append(pair)
    if useless:
        of_cylinders = listed([column.name for (column, *_) in useless], 12)
        reasons.append(f"{USELESS}: {of_cylinders}: {NEEDED}")
        left = [pair for pair in left if pair not in useless]
    if given and from_zero:
        reasons.append("the numbers in the names count from 0: joint 1 is number 0")
    if left and not given:
        order, why = range(1, len(names) + 1), "by its place in the log: check it"
        left = [
            pair for pair in left if not any(give(pair, joint, why) for joint in order)
        ]
    if left:
        spare = listed([column.name for pair in left for column in pair], 12)
        free = [name for joint, name in enumerate(names, 1) if joint not in given]
        whose = (
            f"whose {kind} is it: {' or '.join(free)}?"
            if free
            else "every joint has one already"
        )
        reasons.append(f"left out, though like a joint's {kind}: {spare}; {whose}")
    return given


def _suits(column: _Column, *, slides: bool, has_rod: bool) -> bool:
    """Return whether a column may hold the position of a joint that slides or turns,
    with a cylinder whose pivots are known or without."""
    if _is_raw(column):
        return True
    if slides:
        return not column.unit or column.unit in LENGTHS
    return has_rod or not _is_length(column)


class _Cells(NamedTuple):
    """The cells of a command, or of its two directions, and what they are likely in."""

    values: Array
    likely: CommandRange | None


def _cells(table: Table, columns: Sequence[_Column]) -> _Cells:
    signals = [Signal(column.name, "command", rest=np.nan) for column in columns]
    values = table.read(signals).values.T
    negative = values[1] if len(values) > 1 else None
    return _Cells(values, likely_range(values[0], negative, columns[0].unit))


def _usual_range(commands: Sequence[_Cells]) -> CommandRange | None:
    """Return the range that more than half of a log's commands are in, if it has a
    positive middle."""
    names = [one.likely.name for one in commands if one.likely and one.likely.offset]
    most = max(names, key=names.count, default="")
    if names.count(most) <= len(commands) / 2:
        return None
    return next(
        one.likely for one in commands if one.likely and one.likely.name == most
    )


def _command(
    columns: Sequence[_Column], cells: _Cells, usual: CommandRange | None
) -> tuple[Plain, str]:
    """Return the settings of the columns of a command, and what they are taken for.

    What rests beside the middle is no command: its own rest is 0 %.
    """
    names = [column.name for column in columns]
    likely = cells.likely
    if len(columns) == 1 and (at_rest := resting_range(cells.values[0], likely, usual)):
        rest, likely = at_rest
        likely = likely.with_overshoot(cells.values)
        entry: Plain = {
            "column": names[0],
            "scale": likely.scale,
            "offset": likely.offset,
        }
        return entry, f"{names[0]}: command in {likely.name}, at rest at {rest:.6g}"
    entry: Plain = {"column": names[0] if len(names) == 1 else names}
    if likely is None or "%" in (columns[0].unit, likely.name):
        return entry, f"{' and '.join(names)}: command in %"
    likely = likely.with_overshoot(cells.values)
    entry |= {"scale": likely.scale} | (
        {"offset": likely.offset} if likely.offset else {}
    )
    return entry, f"{' and '.join(names)}: command in {likely.name}"
