"""Columns of two arms in one log: they begin with the arm's name, as right_u2_pct and left_q2_deg do."""

from hydroid.settings.log import DEFAULTS, Columns, LogSettings


def columns_of(settings: LogSettings, side: str) -> LogSettings:
    """Return the settings of a log's columns for one of two arms; the column of the time is common."""

    def named(columns: Columns | None, default: tuple[str, ...] = ()) -> Columns | None:
        if columns is None:
            return None
        names = columns.column or default
        return columns.model_copy(update={"column": tuple(f"{side}_{name}" for name in names) or None})

    common = {kind: named(getattr(settings, kind), columns.column) for kind, columns in DEFAULTS.items()}
    joints = {
        joint: own and own.model_copy(update={kind: named(getattr(own, kind)) for kind in DEFAULTS})
        for joint, own in settings.joints.items()
    }
    return settings.model_copy(update=common | {"joints": joints})


def angles_only(settings: LogSettings) -> LogSettings:
    """Return the settings for a trajectory: whatever commands and pressures it holds are not read."""
    nothing = {"command": None, "pressure": None}
    joints = {joint: own and own.model_copy(update=nothing) for joint, own in settings.joints.items()}
    return settings.model_copy(update=nothing | {"joints": joints})
