"""The page of all settings is up to date and describes each of them."""

import runpy
from pathlib import Path

from hydroid.quantity_table import MECHANICAL, QUANTITIES

DOCS = Path(__file__).parents[2] / "docs"
SCRIPT = runpy.run_path(str(DOCS / "settings_reference.py"))


def test_the_page_is_up_to_date():
    page = (DOCS / "settings.md").read_text(encoding="utf-8")
    assert page == SCRIPT["reference"](), "write it again with `make docs`"


def test_every_setting_is_described():
    assert SCRIPT["undescribed"]() == []


def test_every_quantity_is_described():
    assert all(q.meaning for q in QUANTITIES.values() if q.name not in MECHANICAL)
    assert QUANTITIES["flow_limit"].factor == 1e-3 / 60
