"""File -> `Log`: read, checked, repaired on request, resampled to one period; and back."""

from hydroid.log.delay import Delay, suggest_delay
from hydroid.log.guess import ColumnGuess, guess_columns
from hydroid.log.log import Finding, Log, Warn
from hydroid.log.log_file import check_log, read_log, write_log
from hydroid.log.open_table import open_table
from hydroid.log.table import Table

__all__ = [
    "ColumnGuess",
    "Delay",
    "Finding",
    "Log",
    "Table",
    "Warn",
    "check_log",
    "guess_columns",
    "open_table",
    "read_log",
    "suggest_delay",
    "write_log",
]
