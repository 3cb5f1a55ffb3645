"""The page of the article is what its committed results say."""

import runpy
from pathlib import Path

DOCS = Path(__file__).parents[2] / "docs"
SCRIPT = runpy.run_path(str(DOCS / "reproduction.py"))


def test_the_page_is_up_to_date():
    assert SCRIPT["page"]() == (DOCS / "reproduction.md").read_text(encoding="utf-8")


def test_the_page_has_every_item_and_each_of_the_article_s_conclusions():
    text = (DOCS / "reproduction.md").read_text(encoding="utf-8").replace("\N{NO-BREAK SPACE}", " ")
    for item in [f"table {n}" for n in range(1, 10)] + [f"figure {n}" for n in range(9, 21)]:
        assert f"\n| {item} | " in text
    for study in SCRIPT["studies"]().values():
        for claim in study.claims:
            assert (
                text.count(claim.says) >= 2
            )  # in the table of all, and with its numbers in the study's part
