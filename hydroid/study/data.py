"""The data of a study: logs, or data simulated at the true parameters under pseudo-random commands."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from hydroid.advice.pseudo_random import pseudo_random_log
from hydroid.errors import RunError
from hydroid.log import Log
from hydroid.prediction import simulate_log
from hydroid.settings.fit import FitSettings
from hydroid.settings.study import StudySettings, cell_settings
from hydroid.settings.study_data import SimulatedData

Read = Callable[[Sequence[Path], FitSettings], list[Log]]
"""reads CSV files as settings map them"""


@dataclass(frozen=True, eq=False)
class StudyData:
    """What the runs of a study are fitted to, and what each estimate predicts besides.

    Attributes:
        logs: fitted.
        checks: predicted only, by name: a log, and each cell's settings that simulate it.
    """

    logs: tuple[Log, ...]
    checks: Mapping[str, tuple[Log, Mapping[str, FitSettings]]]


def make_data(
    study: StudySettings, path: Path, settings: FitSettings, read: Read, *, quick: bool
) -> StudyData:
    """Read or simulate the data of a study; `settings` are those of its first cell.

    Raises:
        LogError: a log cannot be used.
        RunError: the simulation at the true parameters diverged.
    """
    longest, data = study.quick.duration_s if quick else np.inf, study.data
    if data.simulated is not None:
        own = data.simulated.model_copy(update={"duration_s": min(data.simulated.duration_s, longest)})
        return StudyData((simulated_log(settings, own, data.truth),), {})
    logs = read([path.parent / name for name in data.logs], settings)
    checks: dict[str, tuple[Log, Mapping[str, FitSettings]]] = {}
    for name, check in data.checks.items():
        own = cell_settings(study, path, quick=quick, extra=check.set)
        (log,) = read([path.parent / check.log], next(iter(own.values())))
        checks[name] = log, own
    if quick:
        logs = [log.first(longest) for log in logs]
        checks = {name: (log.first(longest), own) for name, (log, own) in checks.items()}
    return StudyData(tuple(logs), checks)


def simulated_log(settings: FitSettings, data: SimulatedData, truth: Mapping[str, float]) -> Log:
    """Return a log simulated at the true parameters.

    Raises:
        SettingsError: a true parameter is missing or unknown.
        RunError: the simulation diverged.
    """
    source, columns = "data.truth", [j - 1 for j in settings.outputs]

    def inside(log: Log) -> bool:
        if data.range_deg is None:
            return True
        try:
            angle = np.degrees(simulate_log(settings, log, truth, source).angle[:, columns])
        except RunError:
            return False
        return bool(data.range_deg[0] < angle.min() and angle.max() < data.range_deg[1])

    pose = settings.arm.pose(data.pose)
    commands = pseudo_random_log(pose, list(data.joints), data.duration_s, seed=data.seed, allowed=inside)
    log = simulate_log(settings, commands, truth, source)
    if data.noise_deg == 0:
        return log
    noise = np.random.default_rng([data.seed, 1]).normal(0.0, np.radians(data.noise_deg), log.angle.shape)
    return replace(log, angle=log.angle + noise)
