"""The article's studies: every item has one, each file is sound, and the page is what the results say."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from page import DOCS, page, read_rows
from studies import Plan, load_studies

STUDIES = load_studies()
ITEMS = {f"table {n}" for n in range(1, 10)} | {f"figure {n}" for n in (10, 11, 13, 14, 15, 16, 19, 20)}
ROOT = Path(__file__).parents[2]
each_study = pytest.mark.parametrize("name", STUDIES)


def test_every_table_and_figure_has_a_study_and_every_table_a_claim():
    assert {item for study in STUDIES.values() for item in study.items} == ITEMS
    judged = {claim.item for study in STUDIES.values() for claim in study.claims}
    assert {item for item in ITEMS if item.startswith("table")} - {"table 8"} <= judged  # of another machine


@each_study
def test_a_study_can_run_and_names_only_what_it_has(name: str):
    plan, study = Plan(name, STUDIES[name], quick=True), STUDIES[name]
    assert plan.logs[0].duration <= 16
    assert len(plan.tasks) == (len(plan.cells) * 2 if study.seeds else 0)
    for cell, settings in plan.cells.items():  # the article refines nothing
        assert not plan.tasks or (settings.refinement is None) == ("refined" not in cell)
    named = {c for claim in study.claims for c in (claim.lower, claim.than)}
    named |= {c for figure in study.figures for c in figure.cells}
    named |= {c for table in study.tables for c in (*table.cells, *table.article)}
    assert named <= set(plan.cells)


@each_study
def test_printed_sums_are_the_sums_of_the_printed_errors(name: str):
    """What was typed from the article agrees with itself."""
    for table in STUDIES[name].tables:
        errors = [i for i, column in enumerate(table.columns) if column.startswith("error ")]
        if len(errors) >= 9 and "parameter error" in table.columns:
            at = table.columns.index("parameter error")
            for cell, values in table.article.items():
                assert sum(values[i] or 0.0 for i in errors) == pytest.approx(values[at], abs=0.05), cell


def test_the_page_is_what_the_committed_results_say():
    text = (DOCS / "reproduction.md").read_text(encoding="utf-8")
    assert page(DOCS / "reproduction") == text
    for study in STUDIES.values():
        assert all(f"| {claim.says} |" in text for claim in study.claims)


@pytest.mark.slow
def test_all_studies_run_in_their_short_form():
    shutil.rmtree(ROOT / "runs" / "article-quick", ignore_errors=True)  # an older run's figures
    command = [sys.executable, str(ROOT / "benchmarks" / "article" / "run.py"), "--quick"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=1200, cwd=ROOT)
    assert done.returncode == 0, done.stderr
    results = ROOT / "runs" / "article-quick" / "results"
    drawn = {file.stem.replace("_", " ") for file in results.glob("figure_*.svg")}
    assert drawn == {item for item in ITEMS if item.startswith("figure")}
    text = Path(done.stdout.strip()).read_text(encoding="utf-8")
    assert "short form" in text
    for file in results.glob("*_runs.csv"):
        assert not [row.failed for row in read_rows(file) if row.failed]
