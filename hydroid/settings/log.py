"""How the columns of a log become commands [%] and joint angles [rad]. The defaults fit the shipped logs.

log:
  time: {column: t, unit: ms}
  command: {column: ["up{joint}", "down{joint}"], scale: 10}   # two columns: one per direction
  joints:                       # what differs for single joints
    4: {angle: {unit: rad}}
    7: null                     # not in the log
"""

from typing import Annotated, Any, Literal, TypeVar

from pydantic import AfterValidator, BaseModel, BeforeValidator, Field, model_validator

from hydroid.settings.load import JointNumber, NotNegative, Settings

JOINT = "{joint}"
SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0, "h": 3600.0, "day": 86400.0}
"""in each unit of log.time"""


def _as_columns(value: Any) -> Any:
    columns = (value,) if isinstance(value, str) else value
    if not isinstance(columns, tuple) or not all(isinstance(c, str) and c for c in columns):
        columns = ()
    if len(columns) not in (1, 2):
        raise ValueError("must be a column's name, or two: the positive and the negative direction")
    return columns


def _nonzero(value: float) -> float:
    if value == 0:
        raise ValueError("must not be 0")
    return value


Name = Annotated[str, Field(min_length=1)]
Offset = Annotated[float, Field(ge=-1e12, le=1e12)]
Scale = Annotated[Offset, BeforeValidator(_nonzero)]


class TimeColumn(Settings):
    """The column that holds the time."""

    column: Name = "time_s"
    """name in the header; a ROS bag has a clock of its own and needs none"""
    unit: Literal["s", "ms", "us", "ns", "min", "h", "day"] = "s"
    """unit of the cells; dates and times of day are recognised"""


class CommandColumns(Settings):
    """Columns that hold the commands: command [%] = scale · cell + offset."""

    column: Annotated[tuple[str, ...], BeforeValidator(_as_columns)] = (f"u{JOINT}_pct",)
    """name in the header, with {joint} for the joint's number; or two names, for the positive and the
    negative direction, whose values must lie in [0, 100] % and are subtracted"""
    scale: Scale = 1.0
    """factor on the cells"""
    offset: Offset = 0.0
    """is added to the scaled cells [%]"""


class AngleColumn(Settings):
    """Columns that hold the angles: angle [unit] = scale · cell + offset."""

    column: Name = f"q{JOINT}_deg"
    """name in the header, with {joint} for the joint's number"""
    unit: Literal["deg", "rad"] = "deg"
    """unit of the scaled cells"""
    scale: Scale = 1.0
    """factor on the cells"""
    offset: Offset = 0.0
    """is added to the scaled cells, in `unit`"""


class PressureColumns(Settings):
    """Columns that hold chamber pressures: pressure [unit] = scale · cell + offset."""

    column: tuple[Name, Name] = (f"pA{JOINT}_bar", f"pB{JOINT}_bar")
    """names in the header of chamber A, which pushes to positive angles, and chamber B"""
    unit: Literal["bar", "Pa", "MPa"] = "bar"
    """unit of the scaled cells"""
    scale: Scale = 1.0
    """factor on the cells"""
    offset: Offset = 0.0
    """is added to the scaled cells, in `unit`"""


class JointColumns(Settings):
    """The columns of one joint, where they differ from the common ones."""

    command: CommandColumns | None
    """as log.command; null: the log holds no command of this joint"""
    angle: AngleColumn | None
    """as log.angle; null: the log holds no angle of this joint"""
    pressure: PressureColumns | None = None
    """as log.pressure; null: the log holds no pressures of this joint"""


C = TypeVar("C", CommandColumns, AngleColumn, PressureColumns)


def _names(columns: CommandColumns | AngleColumn | PressureColumns) -> tuple[str, ...]:
    return (columns.column,) if isinstance(columns, AngleColumn) else columns.column


def _common(columns: C | None) -> C | None:
    """Refuse a common column that does not contain the joint's number."""
    for name in _names(columns) if columns else ():
        if JOINT not in name:
            raise ValueError(f"column {name!r} is meant for all joints, so its name must contain {JOINT}")
    return columns


class LogSettings(Settings):
    """The layout of logs: columns, units and tolerances."""

    time: TimeColumn = TimeColumn()
    command: Annotated[CommandColumns | None, AfterValidator(_common)] = CommandColumns()
    """columns of the commands; null: the log holds none"""
    angle: Annotated[AngleColumn | None, AfterValidator(_common)] = AngleColumn()
    """columns of the angles; null: the log holds none"""
    pressure: Annotated[PressureColumns | None, AfterValidator(_common)] = None
    """columns of the chamber pressures; null: the log holds none"""
    joints: dict[JointNumber, JointColumns] = Field(default_factory=dict[int, JointColumns])
    """what differs for single joints, by joint; null: the log does not hold this joint"""
    period_s: Annotated[float, Field(ge=1e-4, le=1)] = 0.01
    """sample period to which logs are resampled [s]: commands are held, angles interpolated"""
    delay_s: Annotated[float, Field(ge=-10, le=10)] = 0.0
    """transport delay: commands act this much later than logged [s]"""
    repair_s: Annotated[float, Field(ge=0, le=10)] = 0.1
    """longest gap that --repair fills [s]"""
    angle_margin_deg: NotNegative = 1.0
    """distance by which angles may lie outside the joint's range [deg]; sensors are noisy at the stops"""
    shortest_s: NotNegative = 0.5
    """duration below which a log is refused [s]"""

    @model_validator(mode="before")
    @classmethod
    def _lay_over(cls, values: Any) -> Any:
        """Complete each joint from the common columns, so that written settings read back the same."""
        joints = values.get("joints") if isinstance(values, dict) else None
        if not isinstance(joints, dict):
            return values
        return {**values, "joints": {joint: _complete(values, own) for joint, own in joints.items()}}

    def command_of(self, joint: int) -> CommandColumns | None:
        """Return the columns of a joint's command, with its number in their names; None: not in the log."""
        return _numbered(self.joints[joint].command if joint in self.joints else self.command, joint)

    def angle_of(self, joint: int) -> AngleColumn | None:
        """Return the column of a joint's angle, with its number in the name; None: not in the log."""
        return _numbered(self.joints[joint].angle if joint in self.joints else self.angle, joint)

    def pressure_of(self, joint: int) -> PressureColumns | None:
        """Return the columns of a joint's pressures, with its number in their names; None: not in the log."""
        return _numbered(self.joints[joint].pressure if joint in self.joints else self.pressure, joint)


def _numbered(columns: C | None, joint: int) -> C | None:
    if columns is None:
        return None
    names = tuple(name.replace(JOINT, str(joint)) for name in _names(columns))
    return columns.model_copy(update={"column": names[0] if isinstance(columns, AngleColumn) else names})


def _complete(common: dict[str, Any], own: Any) -> Any:
    """One joint's columns laid over the common ones; of pressures there are none unless they are named."""
    if own is not None and not isinstance(own, dict):
        return own
    entry: dict[str, Any] = {} if own is not None else {"command": None, "angle": None, "pressure": None}
    entry |= own or {}
    for kind, default in (("command", {}), ("angle", {}), ("pressure", None)):
        base = common.get(kind, default)
        base = base.model_dump() if isinstance(base, BaseModel) else base
        mine = entry.setdefault(kind, base)
        if isinstance(mine, dict) and isinstance(base, dict):
            entry[kind] = {**base, **mine}
    return entry
