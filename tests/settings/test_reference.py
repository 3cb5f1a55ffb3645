"""The page of all settings is up to date and describes each of them."""

import runpy
from pathlib import Path

from hydroid.settings.hydraulics import QUANTITIES, HydraulicSettings

DOCS = Path(__file__).parents[2] / "docs"
SCRIPT = runpy.run_path(str(DOCS / "settings_reference.py"))


def test_the_page_is_up_to_date():
    page = (DOCS / "settings.md").read_text(encoding="utf-8")
    assert page == SCRIPT["reference"](), "write it again with `make docs`"


def test_every_setting_is_described():
    assert SCRIPT["undescribed"]() == []


def test_the_table_of_quantities_has_all_that_settings_and_the_arm_give():
    assert len(QUANTITIES) == 67
    arm = {
        "area_a",
        "area_b",
        "opening_a",
        "opening_b",
        "pivot_distance_1",
        "pivot_distance_2",
        "pivot_angle",
    }
    other = {"rotary_volume", "substeps"}
    assert set(QUANTITIES) - arm == set(HydraulicSettings.model_fields) - other
    assert all(q.meaning for q in QUANTITIES.values())
    assert QUANTITIES["flow_limit"].factor == 1e-3 / 60
