"""Tables: exact for scripts, safe and short for readers."""

import csv
import io
import math
from decimal import Decimal

import pytest
from hypothesis import given, strategies as st

from hydroid.reporting.page import Given, Table
from hydroid.words import three_digits

TEXT = st.text(st.characters(codec="utf-8", exclude_categories=("Cc",)), max_size=30)


def table(*cells: str | float | None) -> Table:
    return Table("title", tuple(f"c{i}" for i in range(len(cells))), (cells,))


@given(st.lists(st.one_of(st.floats(), TEXT), min_size=2, max_size=5))
def test_csv_gives_back_every_bit_and_letter(values: list[float | str]):
    (_, row) = csv.reader(io.StringIO(table(*values).csv()))
    for text, value in zip(row, values, strict=True):
        if isinstance(value, str):
            assert text == value
        else:
            assert float(text) == value or (
                math.isnan(value) and math.isnan(float(text))
            )


def test_bounds_keep_their_bits_in_csv_and_their_digits_elsewhere():
    bounds = table(Given(0.1 + 0.2), Given(57.95))
    assert bounds.csv().splitlines()[1] == f"{0.1 + 0.2!r},57.95"
    assert bounds.shown == [["0.3", "57.95"]]


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_a_shown_number_is_right_to_three_digits(value: float):
    assert abs(Decimal(three_digits(value)) - Decimal(value)) <= abs(
        Decimal(value)
    ) * Decimal("5.01e-3")


def test_without_a_terminal_no_line_is_cut(capsys, monkeypatch):
    monkeypatch.delenv("COLUMNS", raising=False)
    words = tuple(f"[deg] word{i}" * 3 for i in range(12))
    Table("wide", words, (words,)).show()
    shown = capsys.readouterr().out
    assert all(word in shown for word in words)


@pytest.mark.parametrize("width", [60, 100, 200])
def test_a_table_fits_the_terminal_and_names_the_columns_left_out(
    width: int, capsys, monkeypatch
):
    monkeypatch.setenv("COLUMNS", str(width))
    names = tuple(f"value {i}" for i in range(14))
    values = tuple(0.001234 * 1.7**i for i in range(14))
    header = ("name", *names, "flag")
    words = "not identifiable, at upper bound"
    Table("t", header, (("K", *values, words),), "note", names[3:]).show()
    shown = capsys.readouterr().out
    assert max(map(len, shown.splitlines())) <= width
    assert all(word in shown for word in words.split())
    left_out = shown.split("Left out for width: ")[1] if "Left out" in shown else ""
    for name, value in zip(names, values, strict=True):
        assert (three_digits(value) in shown) != (
            name in " ".join(left_out.split()).rstrip(".").split(", ")
        )
    assert ("Left out" in shown) == (width < 150)
    # without optional columns numbers are whole all the same
    Table("narrow", names, (values,)).show()
    whole = capsys.readouterr().out
    assert all(three_digits(value) in whole for value in values)
