"""Tables: exact for scripts, safe and short for readers."""

import csv
import io
import math
import re
from decimal import Decimal

import pytest
from hypothesis import given
from hypothesis import strategies as st
from markdown_it import MarkdownIt

from hydroid.report.table import Given, Table, number, plain

HOSTILE = r"<b>&_%$#{}~^|\*`[x](http://e.org).csv"
TEXT = st.text(st.characters(codec="utf-8", exclude_categories=("Cc",)), max_size=30)


def table(*cells: object) -> Table:
    return Table("title", tuple(f"c{i}" for i in range(len(cells))), (cells,))  # type: ignore[arg-type]


@given(st.lists(st.floats(), min_size=1, max_size=5))
def test_csv_gives_back_every_bit(values: list[float]):
    (_, row) = csv.reader(io.StringIO(table(*values).csv()))
    for text, value in zip(row, values, strict=True):
        assert float(text) == value or (math.isnan(value) and math.isnan(float(text)))


@given(st.lists(TEXT, min_size=2, max_size=4))
def test_csv_gives_back_every_text(texts: list[str]):
    (_, row) = csv.reader(io.StringIO(table(*texts).csv()))
    assert row == texts


def test_bounds_keep_their_bits_in_csv_and_their_looks_elsewhere():
    bounds = table(Given(0.1 + 0.2), Given(57.95))
    assert bounds.csv().splitlines()[1] == f"{0.1 + 0.2!r},57.95"
    assert "| 0.3 | 57.95 |" in bounds.markdown()


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_a_shown_number_is_right_to_four_digits(value: float):
    assert abs(Decimal(number(value)) - Decimal(value)) <= abs(Decimal(value)) * Decimal("5.01e-4")


@given(st.floats(1e-4, 9e6))
def test_ordinary_numbers_have_four_digits_and_no_exponent(value: float):
    for text in (number(value), number(-value).removeprefix("-")):
        assert "e" not in text
        digits = text.replace(".", "").lstrip("0")
        assert len(digits) == 4 or (value >= 1e4 and digits[4:].strip("0") == "")


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.0, "0"), (0.2, "0.2000"), (9.9999, "10.00"), (231.8, "231.8"), (12345.6, "12350"), (math.inf, "–")],
)
def test_numbers_as_read(value: float, text: str):
    assert number(value) == text


@pytest.mark.parametrize(
    ("value", "text"), [(0.05, "0.05"), (5000.0, "5000"), (2e6, "2000000"), (0.0, "0"), (math.nan, "–")]
)
def test_given_numbers_as_given(value: float, text: str):
    assert plain(value) == text


@pytest.mark.parametrize(
    "name", [HOSTILE, r"\|", "a|b", "**bold**", "<script>", "`x`", "[x][y]", "_a_ ~~b~~"]
)
def test_markdown_shows_a_hostile_name_as_it_is(name: str):
    tokens = MarkdownIt("gfm-like", {"linkify": False}).parse(
        Table(name, ("h",), ((name,),), name).markdown()
    )
    inline = [token for token in tokens if token.type == "inline"]
    title, header, cell, note = inline
    for token in (title, cell, note):
        kinds = {child.type for child in token.children or []}
        assert kinds <= {"text", "text_special", "strong_open", "strong_close"}
        assert "".join(child.content for child in token.children or []) == name
    assert header.content == "h"


def test_latex_leaves_no_special_letter_bare():
    source = Table(HOSTILE, (HOSTILE,), ((HOSTILE,), ("[2ex]",), ("*",)), HOSTILE).latex()
    # what stays after all legal commands are taken out
    rest = re.sub(
        r"\\(textbackslash|textasciitilde|textasciicircum|textless|textgreater|textbar)\{\}", "", source
    )
    rest = re.sub(r"\\[&%$#_{}]", "", rest)
    assert not set("%$#_~^<>|") & set(rest)
    assert rest.count("{") == rest.count("}")
    assert "\n{[}2ex] \\\\" in source  # else a length for the line break before it
    assert "\n{*} \\\\" in source


def test_every_face_has_every_cell():
    several = Table("t", ("name", "value"), (("K", 1.5), ("D", None), ("S", math.nan)), "note")
    assert several.markdown().count("\n|") == 5
    assert several.latex().count(r" \\") == 4
    assert several.records() == [
        {"name": "K", "value": 1.5},
        {"name": "D", "value": None},
        {"name": "S", "value": None},  # JSON has no NaN
    ]


def test_numbers_stand_right_and_words_left():
    mixed = Table("t", ("a", "b", "c"), (("x", 1.0, None), ("y", None, "z")))
    assert mixed.numeric == (False, True, False)


def test_without_a_terminal_no_line_is_cut(capsys: pytest.CaptureFixture[str]):
    words = tuple(f"[deg] word{i}" * 3 for i in range(12))
    Table("wide", words, (words,)).show()
    shown = capsys.readouterr().out
    assert all(word in shown for word in words)


def test_numbers_are_whole_in_any_terminal(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setenv("COLUMNS", "60")
    values = tuple(0.001234 * 1.7**i for i in range(14))
    Table("narrow", tuple(f"value {i}" for i in range(14)), (values,)).show()
    shown = capsys.readouterr().out
    assert all(number(value) in shown for value in values)
