"""How the columns of a CSV log become commands [%] and joint angles [rad]; the defaults fit the shipped logs.

log:
  time: {column: t, unit: ms}
  command: {column: ["up{joint}", "down{joint}"], scale: 10}   # two columns: one a direction
  joints:                       # what differs, laid over the common columns
    4: {angle: {unit: rad}}
    7: null                     # not in the log: undriven and unmeasured
"""

from typing import Annotated, Any, Literal, cast

from pydantic import AfterValidator, BaseModel, BeforeValidator, Field, model_validator

from hydroid.settings.load import Settings

JOINT = "{joint}"


def _as_columns(value: Any) -> Any:
    columns = (value,) if isinstance(value, str) else value
    ok = isinstance(columns, list | tuple) and all(isinstance(c, str) and c for c in cast(list[Any], columns))
    if not ok or len(cast(list[Any], columns)) not in (1, 2):
        raise ValueError("must be a column's name, or two: the positive and the negative direction")
    return columns


def _nonzero(value: float) -> float:
    if value == 0:
        raise ValueError("must not be 0")
    return value


Name = Annotated[str, Field(min_length=1)]
Scale = Annotated[float, Field(ge=-1e12, le=1e12), BeforeValidator(_nonzero)]
Offset = Annotated[float, Field(ge=-1e12, le=1e12)]


class TimeColumn(Settings):
    """Where the time stands."""

    column: Name = "time_s"
    unit: Literal["s", "ms"] = "s"


class CommandColumns(Settings):
    """One signed column, or two (positive, negative direction): command [%] = scale · cell + offset.

    With two columns each is scaled so, must lie in [0, 100] %, and the command is the first minus the second.
    """

    column: Annotated[tuple[str, ...], BeforeValidator(_as_columns)] = (f"u{JOINT}_pct",)
    scale: Scale = 1.0
    offset: Offset = 0.0


class AngleColumn(Settings):
    """One column: angle [unit] = scale · cell + offset."""

    column: Name = f"q{JOINT}_deg"
    unit: Literal["deg", "rad"] = "deg"
    scale: Scale = 1.0
    offset: Offset = 0.0


class PressureColumns(Settings):
    """Columns of chambers A (pushes to positive angles) and B: pressure [unit] = scale · cell + offset."""

    column: Annotated[tuple[str, str], Field(min_length=2, max_length=2)] = (
        f"pA{JOINT}_bar",
        f"pB{JOINT}_bar",
    )
    unit: Literal["bar", "Pa", "MPa"] = "bar"
    scale: Scale = 1.0
    offset: Offset = 0.0


class JointColumns(Settings):
    """The columns of one joint; null: the log does not have it."""

    command: CommandColumns | None
    angle: AngleColumn | None
    pressure: PressureColumns | None = None


Columns = CommandColumns | AngleColumn | PressureColumns


def _common(columns: Columns | None) -> Columns | None:
    """Columns of all joints must tell the joints apart."""
    names = (
        () if columns is None else (columns.column,) if isinstance(columns.column, str) else columns.column
    )
    for name in names:
        if JOINT not in name:
            raise ValueError(f"column {name!r} is common to all joints and needs {JOINT} in its name")
    return columns


class LogSettings(Settings):
    """Columns, units and tolerances of a log."""

    time: TimeColumn = TimeColumn()
    command: Annotated[CommandColumns | None, AfterValidator(_common)] = CommandColumns()
    angle: Annotated[AngleColumn | None, AfterValidator(_common)] = AngleColumn()
    pressure: Annotated[PressureColumns | None, AfterValidator(_common)] = None  # most logs have none
    joints: dict[Annotated[int, Field(ge=1)], JointColumns] = Field(default_factory=dict[int, JointColumns])
    period_s: Annotated[float, Field(ge=1e-4, le=1)] = 0.01  # of the Log, whatever the file's rate
    delay_s: Annotated[float, Field(ge=-10, le=10)] = 0.0  # the command acts this much later than logged
    repair_s: Annotated[float, Field(ge=0, le=10)] = 0.1  # longest hole that --repair fills
    angle_margin_deg: Annotated[float, Field(ge=0)] = 1.0  # potentiometers are noisy at the stops
    shortest_s: Annotated[float, Field(ge=0)] = 0.5

    @model_validator(mode="before")
    @classmethod
    def _lay_over(cls, values: Any) -> Any:
        """Complete each joint from the common columns, so that dumped settings read back the same."""
        if not isinstance(values, dict) or not isinstance(cast(Any, values).get("joints"), dict):
            return cast(Any, values)
        given = cast(dict[str, Any], values)
        return {**given, "joints": {joint: _complete(given, own) for joint, own in given["joints"].items()}}

    def command_of(self, joint: int) -> CommandColumns | None:
        """Return the columns of a joint's command, with its number in their names; None: not in the log."""
        own = self.joints[joint].command if joint in self.joints else self.command
        return own and own.model_copy(update={"column": tuple(_numbered(c, joint) for c in own.column)})

    def angle_of(self, joint: int) -> AngleColumn | None:
        """Return the column of a joint's angle, with its number in the name; None: not in the log."""
        own = self.joints[joint].angle if joint in self.joints else self.angle
        return own and own.model_copy(update={"column": _numbered(own.column, joint)})

    def pressure_of(self, joint: int) -> PressureColumns | None:
        """Return the columns of a joint's pressures, with its number in their names; None: not in the log."""
        own = self.joints[joint].pressure if joint in self.joints else self.pressure
        return own and own.model_copy(update={"column": tuple(_numbered(c, joint) for c in own.column)})


def _numbered(column: str, joint: int) -> str:
    return column.replace(JOINT, str(joint))


def _complete(common: dict[str, Any], own: Any) -> Any:
    if own is None:
        return {"command": None, "angle": None, "pressure": None}
    if not isinstance(own, dict):
        return own
    entry = dict(cast(dict[str, Any], own))
    for kind in ("command", "angle", "pressure"):
        # of pressures there are none unless they are named
        base = common.get(kind, None if kind == "pressure" else {})
        base = base.model_dump() if isinstance(base, BaseModel) else base
        mine = entry.setdefault(kind, base)
        if isinstance(mine, dict) and isinstance(base, dict):
            entry[kind] = {**base, **mine}
    return entry
