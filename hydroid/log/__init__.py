"""File -> `Log`: read, checked, repaired on request, resampled to one period; and back."""

from hydroid.log.checks import motion_findings
from hydroid.log.guess import ColumnGuess, guess_columns
from hydroid.log.log import Log, LogFinding, grouped
from hydroid.log.motion import JointMotion, driven_joints, motion_of
from hydroid.log.read import check_log, open_table, write_log, write_logs
from hydroid.log.table import Table

__all__ = [
    "ColumnGuess",
    "JointMotion",
    "Log",
    "LogFinding",
    "Table",
    "check_log",
    "driven_joints",
    "grouped",
    "guess_columns",
    "motion_findings",
    "motion_of",
    "open_table",
    "write_log",
    "write_logs",
]
