"""Parquet files -> a table, by pyarrow."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hydroid.errors import LogError
from hydroid.log.table import ArrayTable, optional_package


def open_parquet(path: Path) -> ArrayTable:
    """Read all columns of a file; timestamps become seconds from the first.

    Raises:
        LogError: it is damaged, or pyarrow is not installed.
    """
    arrow = optional_package("pyarrow", "parquet", str(path))
    parquet = optional_package("pyarrow.parquet", "parquet", str(path))
    try:
        table = parquet.read_table(str(path))
        columns = {name: _values(arrow, table.column(i)) for i, name in enumerate(table.column_names)}
    except Exception as error:  # damaged bytes make pyarrow raise errors of any kind
        reason = " ".join(str(error).split())[:200]
        raise LogError(
            f"cannot be read as Parquet ({reason})", where=str(path), hint="save it again"
        ) from None
    clocks = frozenset(name for name, values in columns.items() if values.dtype.kind == "M")
    columns |= {name: _seconds(columns[name]) for name in clocks}
    return ArrayTable(str(path), "Parquet", columns, clocks=clocks)


def _seconds(stamps: NDArray[Any]) -> NDArray[np.float64]:
    there = stamps[~np.isnat(stamps)]
    since = (stamps - (there[0] if len(there) else stamps[:1])).astype(np.int64) / 1e9
    return np.where(np.isnat(stamps), np.nan, since)


def _values(arrow: Any, column: Any) -> NDArray[Any]:
    """Return a column as floats (NaN for null), timestamps as datetime64, all else as objects."""
    kind, types = column.type, arrow.types
    if types.is_timestamp(kind):
        return column.cast(arrow.timestamp("ns", kind.tz)).to_numpy()
    if any(
        check(kind) for check in (types.is_integer, types.is_floating, types.is_boolean, types.is_decimal)
    ):
        return column.cast("float64", safe=False).to_numpy()
    return np.array([*column.to_pylist(), None], dtype=object)[:-1]
