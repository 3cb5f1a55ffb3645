"""CSV as loggers write it: what stands around the table is left out, and said; the numbers stay the same."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from log_files import cells, faults, lines, read, save

ROWS = lines(cells())
HEAD, DATA = ROWS[0], ROWS[1:]


def rows(*above: list[str], below: list[list[str]] | None = None) -> list[list[str]]:
    return [*above, HEAD, *(below or []), *map(list, DATA)]


def blank_first(table: list[list[str]], labels: list[str]) -> list[list[str]]:
    return [[label, *row] for label, row in zip([*labels, *[""] * len(table)], table, strict=False)]


LAYOUTS: dict[str, tuple[Callable[[], list[list[str]]], str]] = {
    "preamble": (
        lambda: rows(["Operator: A. Lab"], ["Rate", "100"], []),
        "the names are in line 4; lines 1 to 2 above are left out",
    ),
    "preamble of a sheet": (
        lambda: rows(["Rate", "100", "", "", ""], ["Gains", "1", "2", "", ""]),
        "the names are in line 3; lines 1 to 2 above are left out",
    ),
    "units": (lambda: rows(below=[["[s]", "%", "(%)", "deg", "°"]]), "line 2 holds units (s, %, deg, °)"),
    "types": (lambda: rows(below=[["float"] * 5]), "line 2 below the names is text and left out"),
    "groups": (
        lambda: rows(["", "valves", "", "encoders", ""], below=[["s", "%", "%", "deg", "deg"]]),
        "the names are in line 2; line 1 above is left out",
    ),
    "labels in a blank first column": (
        lambda: blank_first(rows(["a", "b", "c", "d", "e"], below=[["s", "%", "%", "deg", "deg"]]), [
            "descr", "values", "unit",
        ]),
        "the names are in line 2; line 1 above is left out",
    ),
    "blank first column": (lambda: blank_first(ROWS, []), ""),
    "names in a comment": (
        lambda: [["# a rig"], ["# " + HEAD[0], *HEAD[1:]], *DATA],
        "the names are in line 2, a comment",
    ),
}  # fmt: skip


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("separator", [",", ";", "\t"])
def test_the_table_is_found_in_any_layout(layout: str, separator: str, tmp_path: Path) -> None:
    table, remark = LAYOUTS[layout]
    reference, _ = read(save(tmp_path / "plain.csv", ROWS))
    log, findings = read(save(tmp_path / "log.csv", table(), separator))
    said = [f.what for f in findings if not f.what.startswith("read as")]
    assert said[:1] == ([remark] if remark else [])
    assert all(f.level == "note" for f in findings)
    np.testing.assert_array_equal(log.time, reference.time)
    np.testing.assert_array_equal(log.command, reference.command)
    np.testing.assert_array_equal(log.angle, reference.angle)


@pytest.mark.parametrize(("line", "cell", "text"), [(1, 0, "x"), (1, 3, "?"), (2, 2, ""), (40, 1, "3 V")])
def test_a_faulty_cell_below_a_preamble_has_its_place(
    line: int, cell: int, text: str, tmp_path: Path
) -> None:
    table = rows(["Rate", "100"], below=[["s", "%", "%", "deg", "deg"]])
    table[2 + line][cell] = text
    (fault,) = faults(save(tmp_path / "log.csv", table))
    assert (fault.line, fault.column) == (3 + line, HEAD[cell])


def test_a_torn_row_below_the_names_is_a_fault(tmp_path: Path) -> None:
    assert faults(save(tmp_path / "log.csv", rows(below=[["broken", "off"]])))[0].line == 2
