"""The article's studies: files are sound, only what is missing runs, the page is what
the results say."""

import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from page import DOCS, page
from run import by_worth, with_what_needs_no_search
from studies import BLIND, CENTRE, RECORDS, Plan, load_studies, read_runs

STUDIES = load_studies()
ITEMS = {f"table {n}" for n in range(1, 10) if n != 8} | {
    f"figure {n}" for n in (13, 14, 15, 16, 20)
}
FIGURES = {f"figure_{n}" for n in (10, 11, 13, 14, 15, 16, 19, 20)}
ROOT = Path(__file__).parents[2]
each_study = pytest.mark.parametrize("name", STUDIES)


def test_every_table_and_figure_with_an_order_has_a_claim():
    claims = [claim for study in STUDIES.values() for claim in study.claims]
    assert {claim.item for claim in claims} >= ITEMS  # table 8 is another machine's
    assert len({claim.says for claim in claims}) == len(claims)


@each_study
def test_a_study_can_run_and_names_only_what_it_has(name: str):
    plan, study = Plan(name, STUDIES[name], quick=True), STUDIES[name]
    assert plan.log(1).duration <= 16
    for cell, settings in plan.cells.items():  # the article refines nothing
        assert not study.seeds or (settings.refinement is None) == (
            "refined" not in cell
        )
    named = {c for claim in study.claims for c in (claim.lower, claim.than)}
    named |= {c for figure in study.figures for c in figure.cells}
    named |= {c for table in study.tables for c in table.cells}
    assert named <= {*plan.cells, "", BLIND, CENTRE, RECORDS}


def test_seeds_beyond_the_shared_record_have_a_record_and_a_truth_of_their_own():
    plan = Plan("wide", STUDIES["wide"], quick=True)
    one, other = plan.truth(1), plan.truth(2)
    assert one != other != STUDIES["wide"].truth
    assert not np.array_equal(plan.log(1).command, plan.log(2).command)
    shared = Plan("mechanical", STUDIES["mechanical"], quick=True)
    assert shared.log(1) is shared.log(10)
    assert shared.truth(10) == STUDIES["mechanical"].truth != shared.truth(11)


def test_what_is_committed_is_not_run_again_and_the_cheapest_claim_comes_first():
    results = DOCS / "reproduction"
    plans = {name: Plan(name, study) for name, study in STUDIES.items()}
    runs = {name: read_runs(results / f"{name}_runs.csv") for name in plans}
    todo = by_worth(plans, runs)
    have = {(n, run["cell"], run["seed"]) for n, made in runs.items() for run in made}
    wanted = {
        (n, c, s)
        for n, plan in plans.items()
        for c in plan.cells
        for s in plan.seeds(c)
    }
    assert len(todo) == len(set(todo))
    assert set(todo) == wanted - have
    fresh = by_worth(plans, {name: [] for name in runs})
    assert set(fresh) == wanted
    assert {seed for _, _, seed in fresh[:12]} <= set(range(1, 7))


def test_measures_that_an_older_run_lacks_are_added_from_its_estimate():
    plan = Plan("wide", STUDIES["wide"], quick=True)
    runs = with_what_needs_no_search(plan, read_runs(Path("none")))
    assert [run["cell"] for run in runs] == [BLIND, CENTRE]
    older = [{name: run[name] for name in run if "error" not in name} for run in runs]
    assert with_what_needs_no_search(plan, older) == runs


def test_the_page_is_what_the_committed_results_say():
    text = (DOCS / "reproduction.md").read_text(encoding="utf-8")
    assert page(DOCS / "reproduction") == text
    for study in STUDIES.values():
        assert all(f"| {claim.says} |" in text for claim in study.claims)
    assert {
        file.stem for file in (DOCS / "reproduction").glob("figure_*.svg")
    } == FIGURES


@pytest.mark.slow
def test_all_studies_run_in_their_short_form():
    results = ROOT / "runs" / "article-quick" / "results"
    shutil.rmtree(results, ignore_errors=True)  # an older run's
    command = [
        sys.executable,
        str(ROOT / "benchmarks" / "article" / "run.py"),
        "--quick",
    ]
    done = subprocess.run(
        command, capture_output=True, text=True, timeout=600, cwd=ROOT
    )
    assert done.returncode == 0, done.stderr
    assert {file.stem for file in results.glob("figure_*.svg")} == FIGURES
    assert "short form" in Path(done.stdout.strip().splitlines()[-1]).read_text(
        encoding="utf-8"
    )
    for name, study in STUDIES.items():
        runs = read_runs(results / f"{name}_runs.csv")
        plan = Plan(name, study, quick=True)
        assert not study.seeds or {*plan.cells} <= {run["cell"] for run in runs}
        assert not [run for run in runs if "failed" in run]
