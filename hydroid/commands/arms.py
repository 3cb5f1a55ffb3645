"""Logs of an arm that stands alone, or of the arms of a pair that move, by the arm's name."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from hydroid.commands.inputs import Source, read_commands, read_logs
from hydroid.errors import SettingsError
from hydroid.settings.fit import FitSettings
from hydroid.settings.two_arms import angles_only, columns_of

if TYPE_CHECKING:
    from hydroid.log import Log

BOTH = "both"
"""the arms of a pair together"""


def read_arms(
    log: "Source | Log",
    settings: FitSettings,
    arm: str | None,
    *,
    pose: str | None = None,
    repair: bool = False,
) -> "dict[str, Log]":
    """Read commands.

    Args:
        log: a file or a log. Columns that begin with `right_` and `left_` are those of the two arms. Without
            them every arm that moves has the same commands: both move as mirror images.
        settings: which map its columns.
        arm: right, left or both: the arms of the pair that move; None: the arm stands alone.
        pose: as in `read_commands`.
        repair: fill holes up to `log.repair_s`.

    Returns:
        Logs by the arm's name: right, left, or alone.

    Raises:
        LogError: a fault that keeps the log from being used.
        SettingsError: no such arm or pose.
    """
    return _by_arm(log, settings, arm, lambda path, own: read_commands(path, own, pose, repair=repair))


def read_trajectories(
    log: "Source | Log", settings: FitSettings, arm: str | None, *, repair: bool = False
) -> "dict[str, Log]":
    """Read joint angles over time, as `read_arms` reads commands.

    A joint without angles stands in `settings.start_pose`.
    """

    def read(path: Source, own: FitSettings) -> "Log":
        angles = own.model_copy(update={"log": angles_only(own.log), "outputs": ()})
        (log,) = read_logs([path], angles, repair=repair)
        return log

    return _by_arm(log, settings, arm, read)


def _by_arm(
    log: "Source | Log",
    settings: FitSettings,
    arm: str | None,
    read: "Callable[[Source, FitSettings], Log]",
) -> "dict[str, Log]":
    from hydroid.arm.machine import ALONE, SIDES

    moving: tuple[str, ...] = (ALONE,)
    if arm is not None:
        if arm not in (*SIDES, BOTH):
            hint = f"choose {', '.join(SIDES)} or {BOTH}"
            raise SettingsError(f"{arm!r} is no arm of a pair", where="--arm", hint=hint)
        moving = SIDES if arm == BOTH else (arm,)
    if not isinstance(log, str | Path):
        return dict.fromkeys(moving, log)
    if arm is not None and _names_arms(Path(log), settings):
        columns = {side: columns_of(settings.log, side) for side in moving}
        return {side: read(log, settings.model_copy(update={"log": own})) for side, own in columns.items()}
    return dict.fromkeys(moving, read(log, settings))


def _names_arms(path: Path, settings: FitSettings) -> bool:
    """Whether a file has a column of one of two arms."""
    from hydroid.arm.machine import SIDES
    from hydroid.log import open_table

    prefixes = tuple(f"{side}_" for side in SIDES)
    return any(name.startswith(prefixes) for name in open_table(path, settings.log).names)
