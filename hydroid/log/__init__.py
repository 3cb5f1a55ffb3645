"""CSV -> `Log`: read, checked, repaired on request, resampled to one period; and back."""

from hydroid.log.delay import Delay, suggest_delay
from hydroid.log.finding import Finding, Warn
from hydroid.log.log import Log
from hydroid.log.reader import check_log, read_log
from hydroid.log.write import write_log

__all__ = ["Delay", "Finding", "Log", "Warn", "check_log", "read_log", "suggest_delay", "write_log"]
