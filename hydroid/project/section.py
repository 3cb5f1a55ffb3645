"""The `log` section of a fit's settings: guessed from a log, or as a person gave it,
joint by joint."""

from collections.abc import Mapping, Sequence

from hydroid.errors import LogError, SettingsError
from hydroid.files import Plain
from hydroid.log import ColumnGuess, Table, guess_columns
from hydroid.log.clues import LONGEST_NUMBER
from hydroid.log.guess import counter_reasons, nearest_period, usual_step
from hydroid.log.rods import Rod, rods_of
from hydroid.log.table import Signal
from hydroid.project.columns import holds_numbers
from hydroid.settings.arm import Arm
from hydroid.settings.log import ColumnMap, Kind, LogSettings
from hydroid.units import UNITS

KINDS: tuple[Kind, ...] = ("command", "angle", "pressure")
PERIOD = 0.02
"""at which `init` looks at quick logs, and of their simulation [s]"""
LONGEST_PERIOD = 0.07
"""of a simulation [s]: a joint's lever changes in a step"""


def guessed_section(
    tables: Sequence[Table], arm: Arm, order: Sequence[str]
) -> ColumnGuess:
    """Guess the columns of the first of some logs; joints have the numbers of the arm.

    `order` are names of the arm's joints in the order of the log's numbers; none: the
    arm's order.
    """
    names = arm.joint_names
    places = _places(names, order)
    slides = list[int]()
    own_rods = dict[int, Rod]()
    ranges = dict[int, tuple[float, float]]()
    rods = rods_of(arm)
    for number, place in enumerate(places, 1):
        joint = arm.joints[place]
        if joint.slides:
            slides.append(number)
        if place + 1 in rods:
            own_rods[number] = rods[place + 1]
        if not joint.continuous:
            ranges[number] = joint.limits
    links = [arm.link_names[place] for place in places]
    try:
        guess = guess_columns(
            tables,
            [names[place] for place in places],
            links=links,
            slides=slides,
            rods=own_rods,
            ranges=ranges,
        )
    except LogError:
        if not holds_numbers(tables[0]):
            raise
        return ColumnGuess({"joints": {}}, tuple(counter_reasons(tables[0])), ())
    section = guess.log
    section["period_s"] = _period(section["period_s"])
    section["joints"] = _by_place(section["joints"], places)
    return guess._replace(mirrored=_by_place(guess.mirrored, places))


def _by_place(settings: Mapping[int, Plain], places: Sequence[int]) -> dict[int, Plain]:
    """Return settings by the joints' numbers in the arm, in place of those in the
    log."""
    of_the_arm = dict[int, Plain]()
    for number, entry in settings.items():
        of_the_arm[places[number - 1] + 1] = entry
    return dict(sorted(of_the_arm.items()))


def _places(names: Sequence[str], order: Sequence[str]) -> list[int]:
    """Return the places among the arm's joints of those of an order, by name or number
    from 1, or of all."""
    places = list[int]()
    for joint in order:
        place = _place(names, joint)
        if place is None:
            hint = f"the arm's joints: {', '.join(names)}"
            raise SettingsError(f"no joint {joint!r}", "--joints", hint)
        if place in places:
            raise SettingsError(f"joint {joint!r} occurs twice", "--joints")
        places.append(place)
    return places or [*range(len(names))]


def _place(names: Sequence[str], joint: str) -> int | None:
    """Return the place of a joint by its name or its number from 1; None: there is
    none."""
    if joint in names:
        return names.index(joint)
    if joint.isascii() and joint.isdecimal() and len(joint) <= LONGEST_NUMBER:
        number = int(joint)
        if 1 <= number <= len(names):
            return number - 1
    return None


def _period(period: float) -> float:
    """Return the period [s] at which `init` looks at a log of another one: finer, where
    the log is slow, to see when joints begin to move."""
    if period < 0.03:
        return max(period, PERIOD)
    return PERIOD if period < 0.1 else 0.05


def simulation_period(table: Table, settings: LogSettings) -> float:
    """Return the period of a simulation of a log [s]: its own, of a quick log PERIOD, of
    a slow one a half, a quarter ... of its own.

    A command that a valve holds for a sample is exact at the log's own period. A longer
    one would average commands that a dead band tells apart.
    """
    period = max(_sample_time(table, settings), PERIOD)
    # so that each sample is still one of the steps
    while period >= LONGEST_PERIOD:
        period = period / 2
    return period


def given_section(table: Table, arm: Arm, given: LogSettings) -> Plain:
    """Return what a person says of the columns, joint by joint."""
    entries = dict[int, Plain]()
    for joint in range(1, len(arm.joints) + 1):
        entry = _joint_entry(given, joint)
        if entry:
            entries[joint] = {"command": None, "angle": None} | entry
    section = given.model_dump(mode="json", exclude_defaults=True)
    section["joints"] = entries
    section["time"] = given.time.model_dump()
    # joint by joint: nothing is common to all
    section["command"] = section["angle"] = None
    if given.pressure is not None:
        section["pressure"] = None
    if "period_s" not in given.model_fields_set:
        section["period_s"] = _period(_sample_time(table, given))
    return section


def _joint_entry(given: LogSettings, joint: int) -> Plain:
    """Return the columns of one joint, by what they hold."""
    entry: Plain = {}
    for kind in KINDS:
        columns = given.columns(kind, joint)
        if columns is not None:
            entry[kind] = _entry(columns)
    return entry


def _sample_time(table: Table, settings: LogSettings) -> float:
    """Return the usual time between samples of a log [s]."""
    column = settings.time
    time = Signal(column.column, "time", gain=UNITS[column.unit].factor)
    (times,) = table.read([time]).values.T
    return nearest_period(usual_step(times))


def _entry(columns: ColumnMap) -> Plain:
    """Return the settings of columns without what is usual."""
    names = [*columns.column]
    entry: Plain = {"column": names[0] if len(names) == 1 else names}
    if columns.unit != "%":
        entry["unit"] = columns.unit
    if columns.scale != 1.0:
        entry["scale"] = columns.scale
    if columns.offset != 0.0:
        entry["offset"] = columns.offset
    return entry


def missing_column(section: Plain, *, targets: bool) -> str:
    """Say what no column looks like; empty: there is all that a fit needs.

    `targets`: there are columns of positions that a controller is to reach.
    """
    if "time" not in section:
        return "no column looks like a time"
    entries = section["joints"].values()
    for kind, words in (("angle", "an angle"), ("command", "a command")):
        if not any(entry[kind] for entry in entries):
            what = f"no column looks like {words}"
            if targets and kind == "command":
                what += ", only like targets of positions: hydroid fits valves"
            return what
    if not any(entry["angle"] and entry["command"] for entry in entries):
        return "no joint has both a command and an angle"
    return ""
