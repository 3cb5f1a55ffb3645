"""Pages: complete, the same every time, self-contained, and safe whatever a log is called."""

import csv
import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from report_fits import make_fit, make_prediction, make_problem, make_record

from hydroid.errors import RunError
from hydroid.fitting.search import HISTORY
from hydroid.reporting.comparison import comparison_page, validation_page
from hydroid.reporting.fit_report import fit_page
from hydroid.reporting.page import Page, Section
from hydroid.reporting.page_file import write_figures, write_page
from hydroid.reporting.table import Table

HOSTILE = "<b>&_%$.csv"


class Reader(HTMLParser):
    """Collects what a page shows and what it refers to."""

    def __init__(self, source: str) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.links: list[str] = []
        self.text, self.source = "", source
        self.feed(source)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.links += [v or "" for name, v in attrs if name in ("src", "href", "action", "data", "srcset")]

    def handle_data(self, data: str) -> None:
        self.text += data


def files(path: Path) -> dict[str, bytes]:
    return {str(p.relative_to(path)): p.read_bytes() for p in sorted(path.rglob("*")) if p.is_file()}


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory):
    problem = make_problem((HOSTILE,))
    fit = make_fit(problem, effects=(1e-3, 1e-3, 0.0, 1e-3))
    path = tmp_path_factory.mktemp("run")
    record = make_record(problem, fit)
    write_page(fit_page(record), path)
    return path, problem, fit, record


def test_writing_again_changes_no_byte(written):
    path, _, _, record = written
    before = files(path)
    write_page(fit_page(record), path)
    assert files(path) == before
    assert {"report.html", "tables/parameters.csv", "tables/errors.tex", "history.csv"} <= set(before)


def test_every_chart_becomes_a_figure_well_formed_and_undated(written, tmp_path: Path):
    files = write_figures(fit_page(written[-1]), tmp_path)
    assert {file.stem for file in files} == {"response_1", "speed", "learning", "pareto"}
    for file in files[1::2]:
        ElementTree.fromstring(file.read_bytes())
        assert b"dc:date" not in file.read_bytes()


def test_history_and_front_come_back_to_the_last_bit(written):
    path, problem, fit, _ = written
    with (path / "history.csv").open(newline="") as file:
        header, *rows = csv.reader(file)
    assert tuple(header) == HISTORY
    assert np.array_equal(np.array(rows, dtype=float), fit.history)
    with (path / "pareto.csv").open(newline="") as file:
        header, *rows = csv.reader(file)
    theta, evaluation = fit.front
    assert header == [*problem.parameters.names, *(f"segment_{s}_rad" for s in range(1, 5)), "overall_rad"]
    expected = np.column_stack([theta, evaluation.segments, evaluation.overall])
    assert np.array_equal(np.array(rows, dtype=float), expected)


def test_the_page_loads_nothing_from_elsewhere_and_a_name_is_text(written):
    source = (written[0] / "report.html").read_text(encoding="utf-8")
    page = Reader(source)
    assert not page.links
    assert "default-src 'none'" in source  # what would load all the same is refused by the browser
    own = re.sub(r'<script type="text/plain".*?</script>', "", source, flags=re.DOTALL)
    assert not re.search(r"https?://(?!www\.w3\.org/2000/svg)|@import|url\(|fetch\(", own)
    assert not {"link", "iframe", "object"} & set(page.tags)
    assert len(source) < 2e6
    assert HOSTILE in page.text  # a name is text
    assert "<b>&_" not in re.sub(r"<script.*?</script>", "", source, flags=re.DOTALL)


def test_a_fit_that_did_not_converge_says_so_first(written):
    _, problem, fit, _ = written
    ending = next(e for e in type(fit.refinement.ending) if not e.converged)
    ended = {"refined": replace(fit.refinement, ending=ending)}
    page = fit_page(make_record(problem, replace(fit, refinements=ended)))
    assert ending.value in page.warnings[0]
    assert page.verdict is not None
    assert {light.question: light.state for light in page.verdict.lights}["Converged"] == "bad"


def test_an_unseen_log_comes_first_and_in_the_verdict():
    problem = make_problem()
    log = replace(problem.logs[0], source="b.csv")
    record = make_record(problem, make_fit(problem), {"b.csv": make_prediction(log)})
    page = fit_page(record)
    (section,) = [s for s in page.sections if s.title == "Prediction"]
    assert [tab.name for tab in section.tabs] == ["b.csv", "a.csv"]
    assert "predicts 1 unseen log with an error of 0.57°" in page.lead
    assert not any("has not seen" in step.what for step in page.sections[0].steps)


def test_runs_side_by_side_share_the_charts_of_a_log():
    problem = make_problem()
    record = make_record(problem, make_fit(problem))
    page = comparison_page({"a": record, "b": record})
    (plot,) = page.sections[0].tabs[0].plots
    labels = {mark.label for panel in plot.draw().panels for mark in panel.marks}
    assert {label.partition(" (")[0] for label in labels} >= {"a", "b", "measured"}
    assert page.tables["parameters"].header == ("name", "unit", "a", "b", "spread [%]")


@pytest.mark.parametrize(("error", "state"), [(0.01, "good"), (0.2, "fair")])
def test_a_validation_says_whether_the_error_is_as_expected(error: float, state: str):
    problem = make_problem()
    one = make_prediction(problem.logs[0], error=error)
    band = replace(one.bands[2], inside=0.5 if error > 0.1 else 0.96, error=error)
    page = validation_page([replace(one, bands={2: band})], problem.settings.arm)
    assert page.verdict is not None
    assert [light.state for light in page.verdict.lights] == [state]
    assert len(page.warnings) == (state == "fair")


def test_a_folder_that_cannot_be_written_is_said(tmp_path: Path):
    (tmp_path / "tables").write_text("in the way")
    page = Page("p", "t", "l", (Section("s", tables={"t": Table("t", ("a",), ((1,),))}),))
    with pytest.raises(RunError, match="cannot be written"):
        write_page(page, tmp_path)
