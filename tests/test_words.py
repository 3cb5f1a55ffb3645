"""Every row of words can be filled, and a sentence agrees with its subjects."""

import math
from string import Formatter

import pytest

from hydroid.findings import WORDS, Finding
from hydroid.words import (
    interval_words,
    listed,
    printable,
    told_apart,
    value_and_interval,
    value_words,
    with_minus,
)

FIELDS = Formatter().parse
"""the fields of a text to be filled, each with the letters before it"""


@pytest.mark.parametrize("kind", WORDS)
def test_every_row_of_words_is_a_sentence_of_its_subjects_and_numbers(kind: str):
    names = ("A_A", "A_B", "open_A", "delay", "friction")
    fields = {field for text in WORDS[kind] for _, field, _, _ in FIELDS(text) if field}
    numbers = {field: 2.5 for field in fields if field.isidentifier()}
    finding = Finding(kind, "note", names, numbers)
    assert finding.what
    assert "  " not in str(finding)


@pytest.mark.parametrize("names", ["A_A is", "A_A and A_B are"])
def test_a_sentence_agrees_with_its_subjects(names: str):
    finding = Finding(
        "at bound", "warning", tuple(names.split()[:-1:2]), {"side": "upper"}
    )
    assert finding.what.startswith(f"{names} at the upper bound: ")
    assert str(finding).endswith("If it does not, the model lacks something.")


TAKEN = ("names", "few", "is", "s", "side", "kind", "0")


@pytest.mark.parametrize("name", TAKEN)
def test_a_subject_may_be_called_as_a_word_of_the_sentence(name: str):
    at = Finding("at bound", "warning", (name,), {"side": "upper"})
    assert (
        at.what == f"{name} is at the upper bound: a value beyond it would fit better."
    )
    strained = Finding(
        "strained prior", "warning", (name, "K"), details={name: "2.9 above"}
    )
    assert (
        strained.what == f"{name} (2.9 above) and K are far from their priors "
        "(numbers: standard deviations)."
    )


@pytest.mark.parametrize(
    "name", ["\x1b]0;title\x07", "\x9b31m", "\u202egpj.exe", "\udcff"]
)
def test_a_name_does_nothing_to_a_terminal(name: str):
    shown = printable(f"a\t{name}\u00a0ä√\n")
    assert shown.startswith("a\t?")
    assert shown.endswith("\u00a0ä√\n")
    assert shown.replace("\t", "").replace("\n", "").replace("\u00a0", "").isprintable()


@pytest.mark.parametrize(
    ("value", "low", "high", "expected"),
    [
        (42.0, 39.0, 45.3, "42 ± 3"),
        # the farther end counts, and two digits of a half that begins with 1
        (36.5, 29.0, 46.6, "36 ± 10"),
        (0.0208, 0.0203, 0.0213, "0.0208 ± 0.0005"),
        (54.2, 24.0, 121.0, "54 (24 to 121)"),
        (1.08, 0.58, None, "1.1 (from 0.58)"),
        (3.0, None, None, "3 (no interval)"),
    ],
)
def test_a_heading_has_a_value_with_its_interval_in_short(
    value: float, low: float | None, high: float | None, expected: str
) -> None:
    assert value_and_interval(value, low, high) == expected


def test_a_negative_number_has_a_minus_sign_and_a_name_keeps_its_hyphen():
    said = "swing at -52 deg (-5 to -2), log-3.csv, --out x-1, a=-1"
    assert with_minus(said) == "swing at −52 deg (−5 to −2), log-3.csv, --out x-1, a=-1"
    assert with_minus("-.5") == "−.5"


def test_a_long_list_ends_with_how_many_more():
    assert listed(list("abcdefg"), 4) == "a, b, c, d and 3 more"
    assert listed(list("abcde"), 4) == "a, b, c, d and e"
    assert listed([]) == ""


@pytest.mark.parametrize(
    ("pair", "shown"),
    [
        ((2.91, 3.08), ("2.9", "3.1")),
        ((2.91, 2.88), ("2.91", "2.88")),
        ((1.0, 2.0), ("1.0", "2.0")),
        ((0.0791, 0.0794), ("0.0791", "0.0794")),
        ((12.3, 140.0), ("12", "140")),
        ((123.4, 123.1), ("123", "123")),
    ],
)
def test_numbers_side_by_side_have_two_digits_and_three_where_two_would_tie(
    pair, shown
):
    assert told_apart(*pair) == shown


@pytest.mark.parametrize(
    ("low", "high", "expected"),
    [
        (10.889, 28.371, "11 to 28"),
        (11.991, 12.032, "11.991 to 12.032"),
        (0.01142, 0.02861, "0.011 to 0.029"),
        (0.1871, 12731.2, "0.19 to 12731"),
        (0.0, 1.0, "0.0 to 1.0"),
        (None, 4.56789, "up to 4.57"),
        (4.56789, None, "from 4.57"),
        (None, None, ""),
        (2.0, 2.0, "2.0 to 2.0"),
    ],
)
def test_an_interval_shows_two_digits_of_its_width_and_of_its_ends(
    low, high, expected: str
):
    assert interval_words(low, high) == expected


@pytest.mark.parametrize(
    ("value", "low", "high", "expected"),
    [
        (12.3849, 12.373, 12.397, "12.385"),
        (383.2, 265.0, 501.0, "383"),
        (0.01264, 0.0064, 0.0249, "0.0126"),
        (9.134, 8.994, 9.276, "9.13"),
        (-25.1004, -25.143, -25.058, "-25.100"),
        (4.56789, None, 5.0, "4.57"),
        (math.nan, 0.0, 1.0, "–"),
    ],
)
def test_a_value_has_as_many_digits_as_tell_it_from_the_ends_of_its_interval(
    value: float, low: float | None, high: float | None, expected: str
):
    assert value_words(value, low, high) == expected
