from collections.abc import Callable
from pathlib import Path

import pytest
from log_files import assert_same, cells, lines, place, read, save

from hydroid.errors import LogError
from hydroid.log.csv import open_csv

ROWS = lines(cells())


def text(separator: str = ",", decimal: str = ".", end: str = "\n") -> str:
    return end.join(separator.join(row).replace(".", decimal) for row in ROWS) + end


def with_degree_sign(data: str) -> str:
    head, *rest = data.split("\n")
    return "\n".join(
        [head + ",temp °C", *(row + ",warm" if row else "" for row in rest)]
    )


DIALECTS: dict[str, Callable[[], bytes]] = {
    "decimal comma": lambda: text(";", ",").encode(),
    "decimal comma, tab": lambda: text("\t", ",").encode(),
    "decimal comma, quoted": lambda: "\n".join(
        ",".join(f'"{cell.replace(".", ",")}"' for cell in row) for row in ROWS
    ).encode(),
    "byte order mark": lambda: text().encode("utf-8-sig"),
    "utf-16": lambda: text("\t", ",").encode("utf-16"),
    "latin-1": lambda: with_degree_sign(text()).encode("latin-1"),
    "utf-8 degree": lambda: with_degree_sign(text()).encode(),
    "windows": lambda: text(end="\r\n").encode(),
    "old mac": lambda: text(end="\r").encode(),
    "no last line end": lambda: text().rstrip().encode(),
    "blank lines": lambda: ("\n\n" + text() + "\n  \n\n").encode(),
    "comments": lambda: (
        "# rig\n" + text().replace("\n", "\n# note, with comma\n", 9)
    ).encode(),
    "sep=": lambda: ("sep=;\r\n" + text(";", ",", "\r\n")).encode(),
    "quoted header": lambda: (
        ",".join(f'"{n}"' for n in ROWS[0]) + "\n" + text().split("\n", 1)[1]
    ).encode(),
    "quoted cells": lambda: "\n".join(
        ",".join(f'" {c} "' for c in row) for row in ROWS
    ).encode(),
    "columns of spaces": lambda: "\n".join(
        " ".join(f"{c:>12}" for c in row) for row in ROWS
    ).encode(),
    "spaces": lambda: "\n".join(" , ".join(row) for row in ROWS).encode(),
    "trailing separators": lambda: text(";").replace("\n", ";;\n").encode(),
    "trailing separators below": lambda: "\n".join(
        [",".join(ROWS[0]), *(",".join(r) + "," for r in ROWS[1:])]
    ).encode(),
    "empty rows of a sheet": lambda: (text(";") + ";;;;\n;;;;\n").encode(),
    "exponents": lambda: text().replace("\n0.01,", "\n1e-2,").encode(),
}


@pytest.mark.parametrize("dialect", DIALECTS)
def test_the_same_log_in_any_dialect(dialect: str, tmp_path: Path) -> None:
    reference, _ = read(save(tmp_path / "plain.csv", ROWS))
    file = tmp_path / "dialect.csv"
    file.write_bytes(DIALECTS[dialect]())
    log, findings = read(file)
    commas = dialect.startswith(("decimal", "utf-16", "sep"))
    assert [f.what for f in findings] == ["commas are read as decimal points"] * commas
    assert_same(log, reference)


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (b"", "is empty"),
        (b"\n\n# only\n", "is empty"),
        (b"PK\x03\x04\x00\x00", "not a text file"),
        (b"\xff\xfe\x00", "not a text file"),
        (b"0.0,1,2,3,4\n", "line 1: has no header"),
        (b"# 5,6\n0.0,1\n", "line 2: has no header"),
        (b"time_s,u1_pct\n0,1\n\0\0\0", "line 3: holds NUL bytes from here on"),
    ],
)
def test_a_file_that_is_no_log(data: bytes, said: str, tmp_path: Path) -> None:
    file = tmp_path / "log.csv"
    file.write_bytes(data)
    with pytest.raises(LogError, match=said):
        read(file)


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("none.csv", "No such file"),
        (".", "directory"),
        ("null\0byte.csv", "cannot be read"),
    ],
)
def test_a_file_that_cannot_be_read(name: str, said: str, tmp_path: Path) -> None:
    with pytest.raises(LogError, match=said):
        read(tmp_path / name)


HEAD, DATA = ROWS[0], ROWS[1:]


def rows(*above: list[str], below: list[list[str]] | None = None) -> list[list[str]]:
    return [*above, HEAD, *(below or []), *map(list, DATA)]


def blank_first(table: list[list[str]], labels: list[str]) -> list[list[str]]:
    return [
        [label, *row]
        for label, row in zip([*labels, *[""] * len(table)], table, strict=False)
    ]


LAYOUTS: dict[str, tuple[Callable[[], list[list[str]]], str]] = {
    "preamble": (
        lambda: rows(["Operator: A. Lab"], ["Rate", "100"], []),
        "the names are in line 4; what stands above is left out",
    ),
    "preamble of a sheet": (
        lambda: rows(["Rate", "100", "", "", ""], ["Gains", "1", "2", "", ""]),
        "the names are in line 3; what stands above is left out",
    ),
    "units": (lambda: rows(below=[["[s]", "%", "(%)", "deg", "°"]]), "line 2 is text and left out"),
    "types": (lambda: rows(below=[["float"] * 5]), "line 2 is text and left out"),
    "groups": (
        lambda: rows(["", "valves", "", "encoders", ""], below=[["s", "%", "%", "deg", "deg"]]),
        "the names are in line 2; what stands above is left out",
    ),
    "labels in a blank first column": (
        lambda: blank_first(rows(["a", "b", "c", "d", "e"], below=[["s", "%", "%", "deg", "deg"]]), [
            "descr", "values", "unit",
        ]),
        "the names are in line 2; what stands above is left out",
    ),
    "blank first column": (lambda: blank_first(ROWS, []), ""),
}  # fmt: skip


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("separator", [",", ";", "\t"])
def test_the_table_is_found_in_any_layout(
    layout: str, separator: str, tmp_path: Path
) -> None:
    table, remark = LAYOUTS[layout]
    reference, _ = read(save(tmp_path / "plain.csv", ROWS))
    log, findings = read(save(tmp_path / "log.csv", table(), separator))
    assert [f.what for f in findings][:1] == ([remark] if remark else [])
    assert all(f.level == "note" for f in findings)
    assert_same(log, reference)


@pytest.mark.parametrize(
    ("line", "cell", "text"), [(1, 0, "x"), (1, 3, "?"), (2, 2, ""), (40, 1, "3 V")]
)
def test_a_faulty_cell_below_comments_and_a_preamble_has_its_place(
    line, cell, text, tmp_path
) -> None:
    table = rows(["# one"], [], ["Rate", "100"], below=[["s", "%", "%", "deg", "deg"]])
    table[4 + line][cell] = text
    _, (left_out, *_) = read(save(tmp_path / "log.csv", table))
    assert place(left_out) == f"line {5 + line}, column {HEAD[cell]}"


def test_a_torn_row_below_the_names_is_left_out(tmp_path: Path) -> None:
    _, (left_out,) = read(save(tmp_path / "log.csv", rows(below=[["broken", "off"]])))
    assert (left_out.kind, place(left_out)) == ("row left out", "line 2")


def test_names_and_cells_of_different_number(tmp_path: Path) -> None:
    """A last name without cells, and a first column of row numbers without a name."""
    plain, _ = read(save(tmp_path / "plain.csv", ROWS))
    more = [[*HEAD, "note"], *DATA]
    numbered = [HEAD, *([str(k), *row] for k, row in enumerate(DATA, 1))]
    for table, remark in (
        (more, "lines hold 5 cells: note has none"),
        (numbered, "the first column has no name"),
    ):
        log, (finding,) = read(save(tmp_path / "log.csv", table))
        assert finding.what == remark
        assert_same(log, plain)


def test_quoted_commas_of_thousands_are_no_decimal_ones(tmp_path: Path) -> None:
    """A spreadsheet writes 1,500 so beside numbers with points."""
    log = tmp_path / "log.csv"
    log.write_text('t,q\n0.5,"1,500"\n1.0,"1,600"\n')
    assert open_csv(log).remarks == ()
    log.write_text('t,q\n"0,5","1,500"\n"1,0","1,600"\n')
    table = open_csv(log)
    assert table.columns["q"].tolist() == [1.5, 1.6]
    assert table.remarks == ("commas are read as decimal points",)
