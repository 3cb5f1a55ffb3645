"""Pages: complete, the same every time, self-contained, and safe whatever a log is called."""

import csv
import re
from collections.abc import Sequence
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from report_fits import MODEL, make_fit, make_problem

from hydroid.errors import RunError
from hydroid.fitting.search import HISTORY
from hydroid.fitting.validation import error_indices
from hydroid.report.fit_report import fit_page
from hydroid.report.page import Page, Section
from hydroid.report.page_file import read_page, write_figures, write_page
from hydroid.report.spread import run_result, spread_page
from hydroid.report.table import Table
from hydroid.report.validation_report import Validation, validation_page

HOSTILE = "<b>&_%$.csv"
IDENTITY = {"hydroid": "0", "mujoco": "4", "logs": {"a.csv": "f" * 64}}


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


def read(path: Path) -> Reader:
    return Reader(path.read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory):
    problem = make_problem((HOSTILE,))
    fit = make_fit(problem, effects=(1e-3, 1e-3, 0.0, 1e-3))
    path = tmp_path_factory.mktemp("run")
    return path, problem, fit, write_page(fit_page(IDENTITY, problem, fit), path)


def test_a_fits_report_has_all_its_files_and_no_others(written):
    path, _, _, paths = written
    tables = {
        f"tables/{t}.{e}"
        for t in ("parameters", "errors", "quantities", "directions", "noise", "correlation")
        for e in ("csv", "md", "tex")
    }
    rest = {"history.csv", "pareto.csv", "tables/curves.csv", "responses/response.csv", "report.html"}
    assert set(files(path)) == tables | rest
    assert sorted(paths) == sorted(path / name for name in files(path))


def test_writing_again_changes_no_byte(written):
    path, problem, fit, _ = written
    before = files(path)
    write_page(fit_page(IDENTITY, problem, fit), path)
    assert files(path) == before


def test_history_and_front_come_back_to_the_last_bit(written):
    path, problem, fit, _ = written
    with (path / "history.csv").open(newline="") as file:
        header, *rows = csv.reader(file)
    assert tuple(header) == HISTORY
    assert np.array_equal(np.array(rows, dtype=float), fit.history)
    assert all(cell.isdigit() for row in rows for cell in row[:4])
    with (path / "pareto.csv").open(newline="") as file:
        header, *rows = csv.reader(file)
    theta, evaluation = fit.front
    assert header == [*problem.parameters.names, *(f"segment_{s}_rad" for s in range(1, 5)), "overall_rad"]
    expected = np.column_stack([theta, evaluation.segments, evaluation.overall])
    assert np.array_equal(np.array(rows, dtype=float), expected)


def test_the_page_loads_nothing_from_elsewhere(written):
    source = (written[0] / "report.html").read_text(encoding="utf-8")
    page = Reader(source)
    assert not page.links
    assert "default-src 'none'" in source  # what would load all the same is refused by the browser
    own = re.sub(r'<script type="text/plain".*?</script>', "", source, flags=re.DOTALL)
    assert not re.search(r"https?://(?!www\.w3\.org/2000/svg)|@import|url\(|fetch\(", own)
    assert not {"link", "iframe", "object"} & set(page.tags)
    assert len(source) < 2e6


def test_a_page_can_be_read_again(written, tmp_path: Path):
    content = read_page(written[0] / "report.html")
    assert content["name"] == "report"
    assert content["numbers"]["parameters"]["K"]["bounds"] == [0.05, 0.5]
    titles = [section["title"] for section in content["sections"]]
    assert titles[0] == "Do next"
    assert titles[-1] == "Reproduce"
    (tmp_path / "old.html").write_text("<p>no content</p>")
    with pytest.raises(RunError, match="is no report of this version"):
        read_page(tmp_path / "old.html")
    with pytest.raises(RunError, match="cannot be read"):
        read_page(tmp_path / "none.html")


def test_the_page_shows_a_hostile_name_as_text(written):
    page = read(written[0] / "report.html")
    assert HOSTILE in page.text
    assert "<b>&_" not in re.sub(r"<script.*?</script>", "", page.source, flags=re.DOTALL)


def test_the_page_begins_with_the_verdict_and_ends_with_how_to_reproduce_it(written):
    path, problem, fit, _ = written
    text = read(path / "report.html").text
    for words in ("hydrolek", "joint 2", "seed", "M1: no effect", "2 of 137 simulated", "arm.yaml"):
        assert words in text
    order = (
        "Reproduces the fitted log",
        "Converged",
        "Do next",
        "Prediction of",
        "What is known",
        "Parameters",
    )
    order = (*order, "What is not known", "Directions", "Noise", "How the search", "Pareto set", "Reproduce")
    places = [text.index(words) for words in order[:-1]] + [text.rindex(order[-1])]
    assert places == sorted(places)
    assert fit.refinement is not None
    ending = next(e for e in type(fit.refinement.ending) if not e.converged)
    ended = {"refined": replace(fit.refinement, ending=ending)}
    page = fit_page(IDENTITY, problem, replace(fit, refinements=ended))
    assert "did not converge" in page.lead
    assert ending.value in page.warnings[0]
    assert {light.question: light.state for light in page.verdict.lights}["Converged"] == "bad"
    assert "Let the refinement finish" in page.sections[0].steps[0].what


def test_lights_name_what_is_not_known_and_what_lies_at_a_bound():
    problem = make_problem()
    fit = make_fit(problem, effects=(1e-3, 1e-3, 0.0, 1e-3))
    lights = {light.question: light for light in fit_page(IDENTITY, problem, fit).verdict.lights}
    assert lights["Converged"].state == "good"
    assert lights["Validated on unseen logs"].state == "open"
    assert (lights["Identifiable"].state, "M1" in lights["Identifiable"].answer) == ("bad", True)
    assert lights["Away from bounds"].state == "good"


def test_every_chart_becomes_a_figure_well_formed_and_undated(written, tmp_path: Path):
    files = write_figures(read_page(written[0] / "report.html"), tmp_path)
    assert {file.stem for file in files} == {"response", "speed", "learning", "pareto"}
    for file in files[1::2]:
        ElementTree.fromstring(file.read_bytes())
        assert b"dc:date" not in file.read_bytes()


def test_all_responses_are_shown():
    problem = make_problem(tuple(f"{i}.csv" for i in range(12)), outputs=(2, 4), samples=40)
    fit = make_fit(problem, names=("best",))
    good = fit.best.responses[3].copy()
    good[:, 0] = problem.logs[3].angle[:, 1]
    diverged = fit.best.responses[5] * np.nan
    responses = (*fit.best.responses[:3], good, fit.best.responses[4], diverged, *fit.best.responses[6:])
    page = fit_page(
        IDENTITY, problem, replace(fit, estimates={"best": replace(fit.best, responses=responses)})
    )
    section = page.sections[1]
    assert [tab.name for tab in section.tabs] == [f"{i}.csv" for i in range(12)]
    plots = {plot.name: plot for plot in section.all_plots}
    assert len(plots) == 2 * 12
    assert len(page.tables["errors"].rows) == 2 * 12 + 1


def test_a_folder_that_cannot_be_written_is_said(tmp_path: Path):
    (tmp_path / "tables").write_text("in the way")
    page = Page("p", "t", "l", (Section("s", tables={"t": Table("t", ("a",), ((1,),))}),))
    with pytest.raises(RunError, match="cannot be written"):
        write_page(page, tmp_path)


def test_runs_have_their_spread_their_list_and_a_figure(tmp_path: Path):
    problem = make_problem()
    fits = [make_fit(problem, effects=(1.0, 1.0, 0.0, 1.0), seed=seed) for seed in range(3)]
    runs = [run_result(Path(f"seed-{s}"), s, fit, problem.parameters.names) for s, fit in enumerate(fits)]
    page = spread_page(problem.settings, runs)
    write_page(page, tmp_path)
    table = page.tables["runs_refined"]
    assert [row[2] for row in table.rows[:4]] == list(np.median([fit.best.theta for fit in fits], axis=0))
    assert table.rows[list(MODEL).index("M1")][-1] == "no effect"
    order = np.argsort([fit.best.rms for fit in fits])
    assert [row[1] for row in page.tables["runs"].rows] == list(order)
    assert {"tables/runs_search.csv", "tables/runs.tex", "runs.html"} <= set(files(tmp_path))


def test_validation_overlays_fits_that_saw_the_same_record():
    log = make_problem().logs[0]
    delayed = replace(log, command=np.roll(log.command, 3, axis=0))
    response = log.angle[:, [1, 3]] + 0.01
    indices = {j: error_indices(log.angle[:, j - 1], log.angle[:, j - 1] + 0.01) for j in (2, 4)}
    results = [Validation(name, log, response, indices) for name in ("ga", "ga")]
    page = validation_page([*results, Validation("later", delayed, response, indices)])
    rows = page.tables["validation"].rows
    assert [row[0] for row in rows] == ["ga", "ga", "ga (2)", "ga (2)", "later", "later"]
    assert [row[4] for row in rows] == pytest.approx([np.degrees(0.01)] * 6)
    # two joints, and again for the fit whose record is another one
    names = {plot.name for plot in page.sections[0].all_plots}
    assert names == {f"validation_a_joint_{j}{again}" for j in (2, 4) for again in ("", "_2")}


def test_figures_of_a_validation_are_named_safely_and_apart():
    def names(sources: Sequence[str]) -> list[str]:
        logs = [replace(make_problem().logs[0], source=source) for source in sources]
        each = [
            Validation("ga", log, log.angle[:, [1]], {2: error_indices(*log.angle.T[:2])}) for log in logs
        ]
        return [plot.name for plot in validation_page(each).sections[0].all_plots]

    found = names([HOSTILE, "A.csv", "x/a.csv", "../日 志.csv"])
    assert len({name.lower() for name in found}) == 4
    assert all(re.fullmatch(r"validation_[A-Za-z0-9._-]+_joint_2(_2)?", name) for name in found)


@pytest.mark.parametrize("algorithm", ["ga", "nsga2"])
def test_the_page_says_what_the_pareto_set_of_a_simple_ga_is(algorithm: str):
    problem = make_problem()
    search = problem.settings.search.model_copy(update={"algorithm": algorithm})
    problem.settings = problem.settings.model_copy(update={"search": search})
    page = fit_page(IDENTITY, problem, make_fit(problem, names=("best",)))
    said = [section.text for section in page.sections if "Pareto" in section.title]
    assert ("does not look for the Pareto set" in said[0]) == (algorithm == "ga")
    assert "need not be an optimum" in page.warnings[0]
