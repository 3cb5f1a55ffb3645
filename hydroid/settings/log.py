"""How the columns of a log become commands [%] and joint angles [rad].
The defaults fit the shipped logs.

log:
  time: {column: t, unit: ms}
  command: {column: ["up{joint}", "down{joint}"], scale: 10}   # two columns: one per direction
  joints:                       # what differs for single joints
    4: {angle: {unit: rad}}
    7: null                     # not in the log
"""

import re
from fnmatch import fnmatch
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, NamedTuple

from pydantic import AfterValidator, BeforeValidator, Field, PrivateAttr, ValidationInfo

from hydroid.errors import SettingsError
from hydroid.files import Plain
from hydroid.settings.load import ByJoint, NotNegative, Settings
from hydroid.units import units_of
from hydroid.words import listed

_PART = re.compile(r"\[\d+\]$")


def log_file(source: str | Path) -> Path:
    """Return the file of a log by its source: FILE[2] is the part of FILE after its
    first gap."""
    return Path(_PART.sub("", str(source)))


def ends_with(source: str | Path, pattern: str) -> bool:
    """Return whether a pattern names the file of a log: by its name, as `mon_*.csv`
    does, or by the end of its path, as `monday/*.csv`."""
    ending = Path(pattern)
    tail = Path(*log_file(source).parts[-len(ending.parts) :])
    return fnmatch(str(tail), str(ending))


JOINT = "{joint}"
OTHER = "other"
"""the group of logs that are in no group of `groups`"""
Kind = Literal["command", "angle", "pressure"]
COMMANDS = units_of("command")
ANGLES = units_of("angle")
LENGTHS = units_of("length")
"""units of positions, and of the lengths of cylinders"""
PRESSURES = units_of("pressure")
# a type checker cannot read a table
if TYPE_CHECKING:
    Unit = str
    TimeUnit = str
else:
    Unit = Literal[*COMMANDS, *ANGLES, *LENGTHS, *PRESSURES]
    TimeUnit = Literal[*units_of("time")]


def _nonzero(value: float | None) -> float | None:
    if value == 0:
        raise ValueError("must not be 0")
    return value


def _one_or_more(given: str | tuple[str, ...]) -> tuple[str, ...]:
    if isinstance(given, str):
        return (given,)
    return given


Name = Annotated[str, Field(min_length=1)]
Number = Annotated[float, Field(ge=-1e12, le=1e12)]


class TimeColumn(Settings):
    """The column that holds the time."""

    column: Name = "time_s"
    """name in the header; a ROS bag has a clock of its own and needs none"""
    unit: TimeUnit = "s"
    """unit of the cells; dates and times of day are recognised"""


class Columns(Settings):
    """Columns of one quantity: value = scale · cell + offset. Null: as for all joints,
    or the default."""

    column: Annotated[tuple[Name, ...] | None, BeforeValidator(_one_or_more)] = None
    """name in the header, with {joint} for the joint's number; or two names: the
    positive and the negative direction of a command, whose values lie in [0, 100] % and
    are subtracted; chamber A, which pushes to positive angles, and chamber B of a
    pressure. Default: u{joint}_pct, q{joint}_deg, [pA{joint}_bar, pB{joint}_bar]"""
    unit: Unit | None = None
    """unit of the scaled cells; of the angle of a joint that slides it is one of
    lengths, which of a joint that turns are the length of its cylinder from pin to pin;
    default: %, deg, bar"""
    scale: Annotated[Number | None, AfterValidator(_nonzero)] = None
    """factor on the cells; default: 1"""
    offset: Number | None = None
    """is added to the scaled cells, in `unit`; default: 0"""


class EngineSpeed(Settings):
    """The column of the engine's speed: value = scale · cell + offset."""

    column: Name
    """name in the header"""
    unit: Literal["rpm", "rev/s"] = "rpm"
    """unit of the scaled cells"""
    scale: Annotated[Number, AfterValidator(_nonzero)] = 1.0
    """factor on the cells"""
    offset: Number = 0.0
    """is added to the scaled cells"""
    reference: Annotated[Number, Field(gt=0)]
    """speed at which `pump_flow` and all openings are stated, in `unit`; `init` writes
    the median of the logs"""


class OilTemperature(Settings):
    """The column of the oil's temperature: value = scale · cell + offset."""

    column: Name
    """name in the header"""
    unit: Literal["degC", "degF"] = "degC"
    """unit of the scaled cells"""
    scale: Annotated[Number, AfterValidator(_nonzero)] = 1.0
    """factor on the cells"""
    offset: Number = 0.0
    """is added to the scaled cells"""
    reference: Number
    """temperature at which all openings are stated, in `unit`; `init` writes the median
    of the logs"""


Condition = EngineSpeed | OilTemperature
Input = Literal["engine_speed", "oil_temperature"]
"""what a machine works under besides commands: settings of a log"""
EFFECTS: dict[Input, str] = {
    "engine_speed": "engine_exponent",
    "oil_temperature": "temperature_effect",
}
"""the quantity by which each acts on the joints' speeds"""
WITH_INPUT: dict[str, Input] = {quantity: name for name, quantity in EFFECTS.items()}
"""and the other way round"""

Span = tuple[NotNegative, NotNegative]


def _increasing(spans: tuple[Span, ...]) -> tuple[Span, ...]:
    for begin, end in spans:
        if not begin < end:
            raise ValueError(
                f"a stretch ends after it begins, not [{begin:g}, {end:g}]"
            )
    return spans


class Work(Settings):
    """Where an arm works against the world."""

    column: Name | None = None
    """name in the header of a column that is not 0 while it works; a log without it is
    used whole, with a note; one of the logs of a fit must have it"""
    spans: dict[Name, Annotated[tuple[Span, ...], AfterValidator(_increasing)]] = {}
    """stretches of a log [s], from its first row on, by a pattern of file names, or of
    the ends of paths: {dig_*.csv: [[12, 15.5], [40, 52]]}"""

    def spans_of(self, log: str | Path) -> tuple[Span, ...]:
        """Return the stretches [s] of a log by its file."""
        found = list[Span]()
        for pattern, spans in self.spans.items():
            if ends_with(log, pattern):
                found += spans
        return tuple(found)


class ColumnMap(NamedTuple):
    """The columns of one quantity of one joint, complete: value [unit] = scale · cell +
    offset."""

    column: tuple[str, ...]
    unit: str
    scale: float = 1.0
    offset: float = 0.0


KINDS = {
    "command": ((f"u{JOINT}_pct",), (1, 2), COMMANDS),
    "angle": ((f"q{JOINT}_deg",), (1,), (*ANGLES, *LENGTHS)),
    "pressure": ((f"pA{JOINT}_bar", f"pB{JOINT}_bar"), (2,), PRESSURES),
}
"""default columns of a quantity, how many may hold it, and their units, the default
first"""


def _checked(columns: Columns | None, info: ValidationInfo) -> Columns | None:
    if columns is None:
        return None
    kind = str(info.field_name)
    _, counts, units = KINDS[kind]
    if columns.unit not in (None, *units):
        raise ValueError(f"{columns.unit} is no unit of a log's {kind}s")
    if columns.column and len(columns.column) not in counts:
        raise ValueError(f"{kind} needs {' or '.join(map(str, counts))} column names")
    return columns


OfKind = Annotated[Columns | None, AfterValidator(_checked)]


class JointColumns(Settings):
    """The columns of one joint, where they differ from those of all joints."""

    command: OfKind = Columns()
    """as log.command; null: the log holds no command of this joint"""
    angle: OfKind = Columns()
    """as log.angle; null: the log holds no angle of this joint"""
    pressure: OfKind = Columns()
    """as log.pressure; null: the log holds no pressures of this joint"""


def _common(columns: Columns | None) -> Columns | None:
    if columns is None:
        return None
    for name in columns.column or ():
        if JOINT not in name:
            raise ValueError(
                f"column {name!r} is meant for all joints, so its name must contain {JOINT}"
            )
    return columns


Common = Annotated[OfKind, AfterValidator(_common)]


class LogSettings(Settings):
    """The layout of logs: columns, units and tolerances."""

    time: TimeColumn = TimeColumn()
    command: Common = Columns()
    """columns of the commands; null: the log holds none"""
    angle: Common = Columns()
    """columns of the angles; null: the log holds none"""
    pressure: Common = None
    """columns of the chamber pressures; null: the log holds none"""
    engine_speed: EngineSpeed | None = None
    """column of the engine's speed, which sets the flow of a pump with a limit and, by
    `engine_exponent`, the speeds of joints; null: it is as at all times. All logs of a
    fit must have it"""
    oil_temperature: OilTemperature | None = None
    """column of the oil's temperature, which sets the speeds of joints by
    `temperature_effect`; null: it is as at all times. All logs of a fit must have it"""
    joints: ByJoint[JointColumns | None] = {}
    """what differs for single joints, by joint; null: the log does not hold this
    joint"""
    period_s: Annotated[float, Field(ge=1e-4, le=1)] = 0.01
    """sample period to which logs are resampled [s]: angles are interpolated, held
    commands averaged over the period; those of a slower log change on a line from
    sample to sample"""
    begins_in_motion: bool = False
    """whether joints may move already where logs begin: one that moves steadily in the
    first 0.2 s (or four samples), under a command, then starts at its speed, as if its
    first command had been held before. Parts of a log behind a gap always do; with
    `delay_s` none does"""
    delay_s: Annotated[float, Field(ge=-10, le=10)] = 0.0
    """transport delay: commands act this much later than logged [s]"""
    groups: dict[
        Annotated[str, Field(pattern=r"^\w+$")],
        Annotated[tuple[Name, ...], BeforeValidator(_one_or_more)],
    ] = {}
    """logs that share a day, an oil temperature or an operator, by a name of your
    choice: a pattern of file names, or of the ends of paths, or several, as in {monday:
    mon_*.csv} or {monday: monday/*.csv}. Parameters may have an effect in each (`per:
    group`)"""
    work: Work = Work()
    """stretches in which a joint works against the world, as a bucket that digs: no
    model of free motion holds there. They are left out, and the log is split there"""
    repair_s: Annotated[float, Field(ge=0, le=10)] = 0.1
    """longest gap that --repair fills [s]"""

    _prefix: str = PrivateAttr("")

    def columns(self, kind: Kind, joint: int) -> ColumnMap | None:
        """Return the columns of a joint (number, from 1), its number in their names;
        None: not in the log."""
        common: Columns | None = getattr(self, kind)
        of_joint = self.joints.get(joint, JointColumns())
        own: Columns | None = getattr(of_joint, kind, None)
        if own is None:
            return None
        if common is None and own == Columns():
            return None
        names, _, (unit, *_) = KINDS[kind]
        given: Plain = {"column": names, "unit": unit}
        if common is not None:
            given |= common.model_dump(exclude_none=True)
        given |= own.model_dump(exclude_none=True)
        templates = given.pop("column")
        names = tuple(
            self._prefix + name.replace(JOINT, str(joint)) for name in templates
        )
        return ColumnMap(names, **given)

    def condition(self, name: Input) -> Condition | None:
        """Return the column of what a machine works under; None: not in the log."""
        return getattr(self, name)

    def group_of(self, log: str) -> str:
        """Return the group of a log by its file's name and folders.

        Raises SettingsError: it is in several.
        """
        found = list[str]()
        for group, patterns in self.groups.items():
            if any(ends_with(log, pattern) for pattern in patterns):
                found.append(group)
        if len(found) > 1:
            raise SettingsError(
                f"{log_file(log).name} is in the groups {listed(found)}", "log.groups"
            )
        if found:
            return found[0]
        return OTHER

    def of_arm(self, side: str) -> "LogSettings":
        """Return the columns of one of two arms: their names begin with its own;
        the time's is common."""
        copy = self.model_copy()
        copy._prefix = f"{side}_"
        return copy

    def angles_only(self) -> "LogSettings":
        """Return the columns of a trajectory: whatever else it holds is not read, and no
        stretch of it is left out."""
        nothing = {"command": None, "pressure": None}
        inputs = dict.fromkeys(EFFECTS)
        joints = {
            joint: own and own.changed(nothing) for joint, own in self.joints.items()
        }
        return self.changed(nothing | inputs | {"joints": joints, "work": Work()})
