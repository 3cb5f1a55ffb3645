"""Small logs for the tests of the log room: two joints, the second continuous."""

from pathlib import Path
from typing import Any

import numpy as np

from hydroid.log import Log, LogFinding, Reading, check_log
from hydroid.log.mapping import Ranges
from hydroid.settings.log import LogSettings

RIG = Path(__file__).parents[2] / "examples" / "logs"
DEGREES = (
    (-50, 50),
    (-30, 90),
    (-120, 0),
    (-90, 90),
    (-50, 50),
    (-np.inf, np.inf),
    (0, 60),
)
RIG_RANGES = {
    f"{joint}": tuple(np.deg2rad(ends)) for joint, ends in enumerate(DEGREES, 1)
}
RANGES = {"1": (-0.5, 1.5), "2": (-np.inf, np.inf)}
NAMES = ("time_s", "u1_pct", "u2_pct", "q1_deg", "q2_deg")
SETTINGS = LogSettings()


def cells(rows: int = 80, period: float = 0.01) -> np.ndarray:
    """A valid log as the file holds it: time [s], two commands [%], two angles [deg],
    shape (rows, 5)."""
    time = np.arange(rows) * period
    u = [
        np.round(60 * np.sign(np.sin(20 * time + 0.3)), 2),
        np.round(30 * np.cos(9 * time), 2),
    ]
    q = [10 + 9 * np.sin(3 * time), 200 * np.sin(2 * time)]
    return np.round(np.stack([time, *u, *q], axis=1), 4)


def lines(values: np.ndarray) -> list[list[str]]:
    return [list(NAMES), *([format(x, ".10g") for x in row] for row in values)]


def save(path: Path, rows: list[list[str]], separator: str = ",") -> Path:
    path.write_text(
        "\n".join(separator.join(row) for row in rows) + "\n", encoding="utf-8"
    )
    return path


def head(path: Path, samples: int, log: str = "rig_shoulder_1.csv") -> Path:
    rows = (RIG / log).read_text().splitlines()
    path.write_text("\n".join(rows[: samples + 1]) + "\n")
    return path


def halve(path: Path, most: int = 1500) -> None:
    """Keep the first half of a CSV log, so many samples at most."""
    header, *rows = path.read_text().splitlines(keepends=True)
    path.write_text("".join([header, *rows[: min(len(rows) // 2, most)]]))


def read(
    path: Path,
    settings: LogSettings = SETTINGS,
    ranges: Ranges = RANGES,
    **options: Any,
) -> tuple[Log, list[LogFinding]]:
    """A log that can be used, and its findings; else the first error is raised."""
    log, findings = check_log(path, settings, ranges, Reading(**options))
    if log is None:
        raise findings[0].error()
    return log, findings


def assert_same(log: Log, other: Log) -> None:
    np.testing.assert_array_equal(log.time, other.time)
    np.testing.assert_array_equal(log.command, other.command)
    np.testing.assert_array_equal(log.angle, other.angle)


def faults(
    path: Path,
    settings: LogSettings = SETTINGS,
    ranges: Ranges = RANGES,
    **options: Any,
) -> list[LogFinding]:
    log, findings = check_log(path, settings, ranges, Reading(**options))
    errors = [finding for finding in findings if finding.level == "error"]
    assert (log is None) == bool(errors)
    return errors


def place(finding: LogFinding) -> str:
    """Line and column, without the file."""
    return finding.where.partition(", ")[2]
