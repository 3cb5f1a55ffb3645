"""Units: what one of each is in SI, and that none is taken for one that it is not."""

import numpy as np
import pytest

from hydroid.quantity_table import QUANTITIES, quantity
from hydroid.units import UNITS, display, unit_of


@pytest.mark.parametrize(
    ("unit", "factor"),
    [
        ("kN", 1e3),
        ("[kN]", 1e3),
        ("cm²", 1e-4),
        ("mm²", 1e-6),
        ("cm³/rad", 1e-6),
        ("N/mm", 1e3),
        ("L/min", 1e-3 / 60),
        ("mbar", 1e2),
        ("psi", 6894.757),
        ("rpm", 2 * np.pi / 60),
        ("°/s", np.pi / 180),
        ("N·m·s/rad", 1.0),
    ],
)
def test_a_unit_has_its_factor(unit: str, factor: float):
    found = unit_of(unit)
    assert found is not None
    assert found.factor == pytest.approx(factor, rel=1e-6)


def test_every_quantity_has_a_unit_of_the_table():
    for one in QUANTITIES.values():
        assert not one.unit or one.unit.lower() in UNITS, one.name
        assert one.factor == (UNITS[one.unit.lower()].factor if one.unit else 1.0)


def test_a_quantity_in_an_unknown_unit_is_refused():
    row = {"unit": "furlong", "default": 1.0, "plain": "length"}
    with pytest.raises(
        ValueError, match=r"quantities\.yaml: reach: units\.yaml has no unit furlong"
    ):
        quantity("reach", row)


@pytest.mark.parametrize(
    ("slides", "degrees", "shown", "way", "whole"),
    [
        (False, 57.2957795, 57.2957795, "57.3 deg", 1.0),
        (True, 57.2957795, 1e3, "1 m", 1),
    ],
)
def test_one_table_says_how_an_angle_and_a_position_are_written(
    slides: bool, degrees: float, shown: float, way: str, whole: float
):
    written = display(slides=slides)
    assert written.of_degrees(degrees) == pytest.approx(shown)
    assert written.way(degrees) == way
    assert written.in_setting(1.0) == pytest.approx(1.0 if slides else 57.2957795)
    rounded = written.factor * written.rounded(0.7654321)
    assert rounded == pytest.approx(round(rounded))
    assert abs(rounded - written.factor * 0.7654321) <= whole / 2
