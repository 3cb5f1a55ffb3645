"""Columns of two arms in one log: they begin with the arm's name, as right_u2_pct and left_q2_deg do."""

from hydroid.settings.log import AngleColumn, CommandColumns, JointColumns, LogSettings, PressureColumns

Columns = CommandColumns | AngleColumn | PressureColumns


def columns_of(settings: LogSettings, side: str) -> LogSettings:
    """Return the settings of a log's columns for one of two arms; the column of the time is common."""
    kinds = ("command", "angle", "pressure")

    def named(record: LogSettings | JointColumns) -> dict[str, Columns | None]:
        return {kind: _named(getattr(record, kind), side) for kind in kinds}

    joints = {joint: own.model_copy(update=named(own)) for joint, own in settings.joints.items()}
    return settings.model_copy(update=named(settings) | {"joints": joints})


def angles_only(settings: LogSettings) -> LogSettings:
    """Return the settings for a trajectory: whatever commands and pressures it holds are not read."""
    nothing = {"command": None, "pressure": None}
    joints = {joint: own.model_copy(update=nothing) for joint, own in settings.joints.items()}
    return settings.model_copy(update=nothing | {"joints": joints})


def _named(columns: Columns | None, side: str) -> Columns | None:
    if columns is None:
        return None
    names = columns.column
    named = f"{side}_{names}" if isinstance(names, str) else tuple(f"{side}_{name}" for name in names)
    return columns.model_copy(update={"column": named})
