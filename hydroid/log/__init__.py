"""File -> `Log`: read, checked, repaired on request, resampled to one period; and
back."""

from hydroid.log.binary import FORMATS as FORMATS
from hydroid.log.command_sizes import one_size as one_size, only_command as only_command
from hydroid.log.guess import ColumnGuess as ColumnGuess, guess_columns as guess_columns
from hydroid.log.log import (
    OTHER_UNITS as OTHER_UNITS,
    FileRows as FileRows,
    Log as Log,
    LogFinding as LogFinding,
    by_level as by_level,
    grouped as grouped,
    log_finding as log_finding,
)
from hydroid.log.motion import (
    JointMotion as JointMotion,
    driven_joints as driven_joints,
    motion_of as motion_of,
    stands_still as stands_still,
)
from hydroid.log.motion_checks import motion_findings as motion_findings
from hydroid.log.read import (
    Reading as Reading,
    check_log as check_log,
    check_parts as check_parts,
    open_table as open_table,
)
from hydroid.log.table import Table as Table
from hydroid.log.work import lacked_by_all as lacked_by_all
from hydroid.log.write import write_log as write_log, write_logs as write_logs
