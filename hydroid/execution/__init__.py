"""Where chunks of work run: processes of this machine, or workers of a cluster; not what the work is."""

from hydroid.execution.choice import open_executor
from hydroid.execution.executor import TRIES, Executor, Work

__all__ = ["TRIES", "Executor", "Work", "open_executor"]
