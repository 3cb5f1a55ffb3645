"""CSV -> `Log`: read, checked, repaired on request, resampled to one period; and back."""

from hydroid.log.delay import Delay, suggest_delay
from hydroid.log.log import Finding, Log, Warn
from hydroid.log.log_file import check_log, read_log, write_log

__all__ = ["Delay", "Finding", "Log", "Warn", "check_log", "read_log", "suggest_delay", "write_log"]
