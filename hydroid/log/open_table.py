"""A file of any supported format -> its table of named columns."""

from collections.abc import Sequence
from pathlib import Path

from hydroid.log.bag_file import open_bag
from hydroid.log.csv_file import open_csv, read_start
from hydroid.log.mat_file import open_mat
from hydroid.log.parquet_file import open_parquet
from hydroid.log.table import Table
from hydroid.settings.log import LogSettings

DEFAULT = LogSettings()


def open_table(path: Path, settings: LogSettings = DEFAULT, wanted: Sequence[str] = ()) -> Table:
    """Open a log of any format, told by its first bytes: CSV, .mat, Parquet, a ROS bag or MCAP.

    Args:
        path: the file, or the folder of a ROS 2 bag.
        settings: name of the time column, and period to which the channels of a bag are resampled.
        wanted: names of columns that the settings ask for; they tell the header of a CSV file.

    Raises:
        LogError: it cannot be read, or needs a package that is not installed.
    """
    folder = path.is_dir() if "\0" not in str(path) else False
    start = b"" if folder else read_start(path, 600)
    if start.startswith((b"#ROSBAG V", b"\x89MCAP0", b"SQLite format 3")) or (
        folder and (path / "metadata.yaml").exists()
    ):
        return open_bag(path, settings.time.column, settings.period_s)
    if start.startswith(b"PAR1"):
        return open_parquet(path)
    hdf5 = b"\x89HDF\r\n\x1a\n" in (start[:8], start[512:520])
    if hdf5 or start.startswith(b"MATLAB 5.0 MAT-file") or path.suffix.lower() == ".mat":
        return open_mat(path, hdf5=hdf5)
    return open_csv(path, wanted)
