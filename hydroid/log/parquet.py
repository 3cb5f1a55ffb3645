"""Parquet files -> a table, by pyarrow."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hydroid.log.table import ArrayTable, optional_package, readable


def open_parquet(path: Path) -> ArrayTable:
    """Read all columns of a file; timestamps become seconds from the first.

    Raises:
        LogError: it is damaged, or pyarrow is not installed.
    """
    arrow = optional_package("pyarrow", "parquet", str(path))
    parquet = optional_package("pyarrow.parquet", "parquet", str(path))
    columns, clocks = dict[str, NDArray[Any]](), set[str]()
    with readable(path, "Parquet"):
        table = parquet.read_table(str(path))
        for name, column in zip(table.column_names, table.columns, strict=True):
            kind, is_a = column.type, arrow.types
            if is_a.is_timestamp(kind):
                clocks.add(name)
                columns[name] = _seconds(column.cast(arrow.timestamp("ns", kind.tz)).to_numpy())
            elif (is_a.is_primitive(kind) and not is_a.is_temporal(kind)) or is_a.is_decimal(kind):
                columns[name] = column.cast("float64", safe=False).to_numpy()
            else:
                columns[name] = np.array([*column.to_pylist(), None], dtype=object)[:-1]
    names = tuple(columns)
    return ArrayTable(
        source=str(path), layout="Parquet", names=names, columns=columns, clocks=frozenset(clocks)
    )


def _seconds(stamps: NDArray[Any]) -> NDArray[np.float64]:
    missing = np.isnat(stamps)
    first = stamps[np.argmin(missing)] if len(stamps) else 0
    return np.where(missing, np.nan, (stamps - first).astype(np.int64) / 1e9)
