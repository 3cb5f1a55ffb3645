"""File -> `Log`: read, checked, repaired on request, resampled to one period; and back."""

from hydroid.log.delay import Delay, suggest_delay
from hydroid.log.direction import Direction, direction_of
from hydroid.log.guess import ColumnGuess, guess_columns
from hydroid.log.log import Finding, Log, Warn, grouped, in_one_line
from hydroid.log.log_file import check_log, read_log
from hydroid.log.open_table import open_table
from hydroid.log.survey import motion_findings, moved, survey
from hydroid.log.table import Table
from hydroid.log.written import write_log

__all__ = [
    "ColumnGuess",
    "Delay",
    "Direction",
    "Finding",
    "Log",
    "Table",
    "Warn",
    "check_log",
    "direction_of",
    "grouped",
    "guess_columns",
    "in_one_line",
    "motion_findings",
    "moved",
    "open_table",
    "read_log",
    "suggest_delay",
    "survey",
    "write_log",
]
