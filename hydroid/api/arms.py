"""Logs of one arm or of two: read and simulated by arm; `collisions` along their angles."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from hydroid.api.look import ModelSource, open_model, read_commands, read_logs
from hydroid.api.model import simulate
from hydroid.api.study import Study
from hydroid.errors import SettingsError
from hydroid.log import Log
from hydroid.settings.fit import FitSettings
from hydroid.settings.two_arms import angles_only, columns_of

if TYPE_CHECKING:
    from hydroid.arm.collision import Clearance

BOTH = "both"
"""the arms of a pair together"""


def read_arms(
    log: str | Path | Log,
    settings: FitSettings,
    arm: str | None,
    *,
    pose: str | None = None,
    repair: bool = False,
) -> dict[str, Log]:
    """Read the commands of an arm that stands alone, or of those arms of a pair that move.

    Args:
        log: a CSV file or a log. Columns that begin with `right_` and `left_` are those of the two arms.
            Without them every arm that moves has the same commands: both move as mirror images.
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


def collisions(
    trajectory: str | Path | Log,
    settings: FitSettings,
    out: str | Path | None = "runs/collisions",
    *,
    arm: str | None = None,
    repair: bool = False,
) -> "Study[Clearance]":
    """Find which bodies meet along a trajectory, when and how deep, and how near they come otherwise.

        study = hydroid.collisions("a.csv", hydroid.load_settings("fit-mech"), arm="right")
        print(study.result.distance.min(), study.result.meetings)

    The bodies are those of the arm, what it stands on, and the floor; with `arm` also the carrier and the
    other arm.

    Args:
        trajectory: a CSV file or a log with joint angles; as the log of `read_arms`. Joints without angles,
            and an arm that does not move, stand in `settings.start_pose`.
        settings: which name the arm and map the columns of angles.
        out: folder for the page, tables and figure; None: nothing is written.
        arm: right, left or both: the arms of the pair that move; None: the arm stands alone.
        repair: fill holes of the trajectory up to `log.repair_s`.

    Raises:
        LogError: the trajectory cannot be used.
        SettingsError: no such arm. ModelError: no two bodies of the model can collide.
    """

    def read(path: str | Path, own: FitSettings) -> Log:
        angles = own.model_copy(update={"log": angles_only(own.log), "outputs": ()})
        (log,) = read_logs([path], angles, repair=repair)
        return log

    logs = _by_arm(trajectory, settings, arm, read)
    from hydroid.arm.machine import load_machine
    from hydroid.report.collision_report import collision_page

    machine = load_machine(settings.arm, pair=arm is not None)
    rest = settings.arm.pose(settings.start_pose)
    angle = machine.joined({side: log.angle for side, log in logs.items()}, rest)
    time = next(iter(logs.values())).time
    result = machine.checker.clearance(time, angle)
    return Study(result, collision_page(result, machine.arm.name)).write(out)


def simulate_arms(
    model: ModelSource,
    logs: Mapping[str, Log],
    out: str | Path | None = None,
    *,
    noise_deg: float = 0.0,
    seed: int = 0,
) -> dict[str, Log]:
    """Simulate the arms of a pair under one estimate, as `simulate` does for an arm that stands alone.

        model = hydroid.load_identified("runs/a")
        logs = hydroid.simulate_arms(model, hydroid.read_arms("a.csv", model.settings, "both"))

    The carrier stands still, and the arms share no pump: neither feels the other.

    Args:
        model: as of `simulate`; it holds for both arms, which mirror each other.
        logs: commands by the arm's name, right or left, as `read_arms` gives them.
        out: a CSV to write with the columns of each arm; None: none.
        noise_deg: standard deviation of Gaussian noise on every angle [deg].
        seed: of the noise on the right arm's angles; the left arm's seed is one higher.

    Returns:
        Logs with the simulated angles by the arm's name.

    Raises:
        RunError: the simulation diverged, or the file cannot be written.
    """
    from hydroid.arm.machine import SIDES
    from hydroid.log import write_logs

    model = open_model(model)
    found: dict[str, Log] = {}
    for side, log in logs.items():
        found[side] = simulate(model, log, noise_deg=noise_deg, seed=seed + SIDES.index(side))
    if out is not None:
        columns = model.settings.log
        write_logs(Path(out), [(log, columns_of(columns, side)) for side, log in found.items()])
    return found


def _by_arm(
    log: str | Path | Log,
    settings: FitSettings,
    arm: str | None,
    read: Callable[[str | Path, FitSettings], Log],
) -> dict[str, Log]:
    from hydroid.arm.machine import ALONE, SIDES

    moving: tuple[str, ...] = (ALONE,)
    if arm is not None:
        moving = SIDES if arm == BOTH else (arm,)
    if arm not in (None, *SIDES, BOTH):
        hint = f"choose {', '.join(SIDES)} or {BOTH}"
        raise SettingsError(f"{arm!r} is no arm of a pair", where="--arm", hint=hint)
    if isinstance(log, Log):
        logs = dict.fromkeys(moving, log)
    elif arm is not None and _names_arms(Path(log), settings):
        own = {side: settings.model_copy(update={"log": columns_of(settings.log, side)}) for side in moving}
        logs = {side: read(log, own[side]) for side in moving}
    else:
        one = read(log, settings)
        logs = dict.fromkeys(moving, one)
    return logs


def _names_arms(path: Path, settings: FitSettings) -> bool:
    """Whether a file has a column of one of two arms."""
    from hydroid.arm.machine import SIDES
    from hydroid.log import open_table

    prefixes = tuple(f"{side}_" for side in SIDES)
    return any(name.startswith(prefixes) for name in open_table(path, settings.log).names)
