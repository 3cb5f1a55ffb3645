"""A file of any supported format -> its table of named columns."""

from collections.abc import Sequence
from pathlib import Path

from hydroid.log.csv_file import open_csv
from hydroid.log.table import Table


def open_table(path: Path, wanted: Sequence[str] = (), period: float = 0.01) -> Table:
    """Open a log of any format, told by its first bytes.

    Args:
        path: the file.
        wanted: names of columns that the settings ask for.
        period: to which channels with clocks of their own are resampled [s].

    Raises:
        LogError: it cannot be read, or needs a package that is not installed.
    """
    return open_csv(path, wanted)
