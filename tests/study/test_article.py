"""The article's studies: every item has one, each file is sound, and all run in their short form."""

import json
import resource
import subprocess
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

from hydroid import article, read_logs
from hydroid.api.studies import article_items
from hydroid.cli.app import app
from hydroid.errors import SettingsError
from hydroid.study.study import StudyPlan, plan_study

FILES = sorted((Path(__file__).parents[2] / "configs" / "article").glob("*.yaml"))


def planned(file: Path) -> StudyPlan:
    return plan_study(file, lambda paths, settings: read_logs(paths, settings), quick=True)


def test_every_table_and_every_figure_of_a_result_has_a_study():
    wanted = {f"table {n}" for n in range(1, 10)} | {f"figure {n}" for n in range(9, 21)}
    assert set(article_items()) == wanted


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_a_study_of_the_article_can_run(file: Path):
    plan = planned(file)
    assert plan.data.logs[0].duration <= plan.study.quick.duration_s + 1
    assert len(plan.tasks) == (len(plan.cells) * 2 if plan.study.seeds else 0)
    for cell, settings in plan.cells.items():  # the article refines nothing
        assert not plan.tasks or (settings.refinement is None) == ("refined" not in cell)


def test_every_item_has_a_verdict():
    judged: set[str] = set()
    for studies in article_items().values():
        for study in studies.values():
            judged |= {claim.item for claim in study.claims if not claim.ours}
            judged |= {figure.item for figure in study.figures if figure.says or figure.orders}
    assert judged == set(article_items())


def test_each_family_of_claims_can_be_confirmed_by_the_seeds_it_has():
    """The smallest p-value of n pairs is 2 / 2^n; Holm multiplies it by the number of claims."""
    for file in FILES:
        study = planned(file).study
        claims = sum(not claim.untested for claim in study.claims)
        assert not claims or 2.0 ** (1 - study.seeds) * claims < 0.05


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_printed_sums_are_the_sums_of_the_printed_errors(file: Path):
    """What was typed from the article agrees with itself."""
    for table in planned(file).study.tables:
        errors = [i for i, column in enumerate(table.columns) if column.startswith("error ")]
        if len(errors) >= 9 and "parameter error" in table.columns:
            at = table.columns.index("parameter error")
            for cell, values in table.article.items():
                total = sum(values[i] or 0.0 for i in errors)
                assert total == pytest.approx(values[at], abs=0.05), cell


def test_an_unknown_item_is_refused_with_the_known_ones(tmp_path: Path):
    for item in ("table 10", "figure 8"):
        with pytest.raises(
            SettingsError, match=rf"{item}: cannot be made; tables 1 to 9 and figures 9 to 20 can"
        ):
            article([item], tmp_path)


@pytest.mark.slow
def test_the_whole_article_runs_in_its_short_form_within_five_minutes_on_two_cores(tmp_path: Path):
    """The bound is on CPU seconds: a clock would measure what else the machine does."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    command = [
        sys.executable,
        "-m",
        "hydroid",
        "article",
        "--all",
        "--quick",
        "--out",
        str(tmp_path),
        "--json",
    ]
    done = subprocess.run(command, capture_output=True, text=True, timeout=1200)
    assert done.returncode == 0, done.stderr
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    assert after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime < 2 * 5 * 60
    studies = json.loads(done.stdout)["studies"]
    assert set(studies) == {file.stem for file in FILES}
    for file in FILES:
        plan = planned(file)
        rows = studies[plan.name]["runs"]
        assert len(rows) == len(plan.tasks)
        assert not [row["failed"] for row in rows if row["failed"]]
        assert len(list((tmp_path / plan.name / "figures").glob("*.png"))) == len(plan.study.figures)
    assert (tmp_path / "article.html").is_file()
    # the simple GA of tables 1 and 6 and figures 14 and 15 is one run
    count = sum(len(found["runs"]) for found in studies.values())
    assert len(list((tmp_path / "runs").glob("*.json"))) < count
    about = json.loads((tmp_path / "about.json").read_text())
    assert about["runs"] == sum(about["code"].values()) < count


def test_one_item_is_made_with_its_own_verdict_and_said_where(tmp_path: Path):
    found = CliRunner().invoke(app, ["article", "--figure", "12", "--quick", "--out", str(tmp_path)])
    assert found.exit_code == 0, found.output
    heading, verdict, *where = found.output.splitlines()
    assert heading == "figure 12: The model, its sensitivity, and the algorithm"
    assert verdict.startswith("- The simple GA is the loop of figure 12: confirmed")
    files = [Path(line.strip()) for line in where if line]
    assert [file.name for file in files] == ["model.html", "figure_12.png"]
    assert all(file.is_file() for file in files)
    assert not (tmp_path / "article.html").exists()  # that is the page of all items
