"""The files of a report: complete, the same every time, self-contained, and safe whatever a log is called."""

import csv
import re
from dataclasses import dataclass, replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from report_fits import folder, make_fit, make_problem

from hydroid.errors import RunError
from hydroid.fitting.search import HISTORY
from hydroid.fitting.validation import ErrorIndices, error_indices
from hydroid.log import Log
from hydroid.report.write import MOST_RESPONSES, write_report, write_runs, write_validation

HOSTILE = "<b>&_%$.csv"


class Page(HTMLParser):
    """Collects what a page shows and what it refers to."""

    def __init__(self, source: str) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.links: list[str] = []
        self.text = ""
        self.feed(source)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.links += [
            value or "" for name, value in attrs if name in ("src", "href", "action", "data", "srcset")
        ]

    def handle_data(self, data: str) -> None:
        self.text += data


def files(path: Path) -> dict[str, bytes]:
    return {str(p.relative_to(path)): p.read_bytes() for p in sorted(path.rglob("*")) if p.is_file()}


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory):
    problem = make_problem((HOSTILE,))
    fit = make_fit(problem, effects=(1e-3, 1e-3, 0.0, 1e-3))
    path = tmp_path_factory.mktemp("run")
    return path, problem, fit, write_report(folder(path), problem, fit)


def test_a_report_has_all_its_files_and_no_others(written):
    path, _, _, paths = written
    named = ("parameters", "errors", "directions", "noise")
    tables = {f"tables/{t}.{e}" for t in named for e in ("csv", "md", "tex")}
    told = ("singular_values", "directions", "correlation")
    names = ("response", "learning", "pareto", "estimates", *told)
    figures = {f"figures/{f}.{e}" for f in names for e in ("png", "svg")}
    rest = {"tables/pareto.csv", "history.csv", "pareto.csv", "report.html"}
    assert set(files(path)) == tables | figures | rest
    assert sorted(paths) == sorted(path / name for name in files(path))


def test_writing_again_changes_no_byte(written):
    path, problem, fit, _ = written
    before = files(path)
    write_report(folder(path), problem, fit)
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
    assert np.array_equal(
        np.array(rows, dtype=float), np.column_stack([theta, evaluation.segments, evaluation.overall])
    )


def test_the_page_loads_nothing_from_elsewhere(written):
    source = (written[0] / "report.html").read_text(encoding="utf-8")
    page = Page(source)
    assert page.links
    assert all(link.startswith("data:image/svg+xml;base64,") for link in page.links)
    assert not re.search(r"https?:|//[a-z]|@import|url\(", re.sub(r"base64,[\w+/=]+", "", source))
    assert not {"script", "link", "iframe", "object"} & set(page.tags)


def test_the_page_shows_a_hostile_name_as_text(written):
    page = Page((written[0] / "report.html").read_text(encoding="utf-8"))
    assert HOSTILE in page.text
    assert "b" not in page.tags


def test_the_page_says_what_to_know(written):
    text = Page((written[0] / "report.html").read_text(encoding="utf-8")).text
    for words in (
        "hydrolek",
        "joint 2",
        "seed",
        "M1: no effect",
        "does not prove",
        "2 of 137 simulated",
        "arm.yaml",
    ):
        assert words in text


def test_svg_figures_are_well_formed_and_undated(written):
    from xml.etree import ElementTree

    for name, content in files(written[0]).items():
        if name.endswith(".svg"):
            ElementTree.fromstring(content)
            assert b"date" not in content.lower()


def test_several_channels_each_have_a_figure_as_far_as_there_is_room(tmp_path: Path, monkeypatch):
    assert MOST_RESPONSES > 3
    monkeypatch.setattr("hydroid.report.write.MOST_RESPONSES", 3)
    problem = make_problem(("a.csv", "b.csv"), outputs=(2, 4))
    fit = make_fit(problem, names=("best",))
    # the second output of the first log is the only good one; one that diverged is the worst of all
    shifts = np.array([[0.3, 0.0], [np.nan, 0.1]])
    responses = tuple(r + shift for r, shift in zip(fit.best.responses, shifts, strict=True))
    fit = replace(fit, estimates={"best": replace(fit.best, responses=responses)})
    write_report(folder(tmp_path), problem, fit)
    drawn = {p.stem for p in (tmp_path / "figures").glob("response*.svg")}
    assert drawn == {"response_1_joint_2", "response_2_joint_2", "response_2_joint_4"}
    assert "1 further response is not drawn" in (tmp_path / "report.html").read_text()


def test_a_folder_that_cannot_be_written_is_said(tmp_path: Path):
    (tmp_path / "tables").write_text("in the way")
    problem = make_problem()
    with pytest.raises(RunError, match="cannot be written"):
        write_report(folder(tmp_path), problem, make_fit(problem))


def test_runs_return_their_final_table(tmp_path: Path):
    problem = make_problem()
    fits = [(seed, problem, make_fit(problem, effects=(1.0, 1.0, 0.0, 1.0), seed=seed)) for seed in range(3)]
    table = write_runs(tmp_path, fits, dict.fromkeys(problem.parameters.names, 1.0))
    assert table.title == "3 runs, refined"
    assert table.rows[0][2] == np.median([fit.best.theta[0] for _, _, fit in fits])
    assert table.rows[-1][0] == "sum of relative errors without M1"
    assert {"tables/runs_search.csv", "tables/runs_refined.tex", "figures/runs.png"} <= set(files(tmp_path))


@dataclass(frozen=True)
class Result:
    fit: str
    log: Log
    response: np.ndarray
    indices: dict[int, ErrorIndices]


def test_validation_overlays_fits_that_saw_the_same_record(tmp_path: Path):
    log = make_problem().logs[0]
    delayed = replace(log, command=np.roll(log.command, 3, axis=0))
    response = log.angle[:, [1, 3]] + 0.01
    indices = {j: error_indices(log.angle[:, j - 1], log.angle[:, j - 1] + 0.01) for j in (2, 4)}
    results = [Result("ga", log, response, indices), Result("ga", log, response, indices)]
    table = write_validation(tmp_path, [*results, Result("later", delayed, response, indices)])
    assert [row[0] for row in table.rows] == ["ga", "ga", "ga (2)", "ga (2)", "later", "later"]
    assert {row[2] for row in table.rows} == {2, 4}
    # two joints, and again for the fit whose record is another one
    names = {p.stem for p in (tmp_path / "figures").glob("*.png")}
    assert names == {f"validation_a_joint_{j}{again}" for j in (2, 4) for again in ("", "_2")}


def test_figures_of_a_validation_are_named_safely_and_apart(tmp_path: Path):
    logs = [replace(make_problem().logs[0], source=s) for s in (HOSTILE, "A.csv", "x/a.csv", "../日 志.csv")]
    results = [Result("ga", log, log.angle[:, [1]], {2: error_indices(*log.angle.T[:2])}) for log in logs]
    write_validation(tmp_path, results)
    names = [p.stem for p in (tmp_path / "figures").glob("*.svg")]
    assert len({name.lower() for name in names}) == len(logs)
    assert all(re.fullmatch(r"validation_[A-Za-z0-9._-]+_joint_2(_2)?", name) for name in names)


@pytest.mark.parametrize("algorithm", ["ga", "nsga2"])
def test_the_page_says_what_the_pareto_set_of_a_simple_ga_is(tmp_path: Path, algorithm: str):
    problem = make_problem()
    search = problem.settings.search.model_copy(update={"algorithm": algorithm})
    problem.settings = problem.settings.model_copy(update={"search": search})
    write_report(folder(tmp_path), problem, make_fit(problem, names=("best",)))
    text = Page((tmp_path / "report.html").read_text(encoding="utf-8")).text
    assert ("does not look for this set" in text) == (algorithm == "ga")
