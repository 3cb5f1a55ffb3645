"""Pages: complete, the same every time, self-contained, and safe whatever a log is
called."""

import base64
import csv
import gzip
import hashlib
import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from report_fits import make_fit, make_prediction, make_problem, make_record

from hydroid.errors import RunError
from hydroid.estimate import FitSummary
from hydroid.fitting.search import HISTORY
from hydroid.fitting.verdict import judge
from hydroid.joint_verdict import Comparison, JointVerdict, Outcome, Verdict
from hydroid.reporting.page import Page, Plot, Section, Table
from hydroid.reporting.page_file import html, write_figures, write_page, write_tables
from hydroid.reporting.predictions import fit_page, validation_page
from hydroid.reporting.verdict_table import (
    horizon_section,
    lead,
    left_out_table,
    next_step,
    ordered,
    verdict_sections,
    verdict_table,
    worst,
)

HOSTILE = "<b>&_%$.csv"


class Reader(HTMLParser):
    def __init__(self, source: str) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.policies: list[str] = []
        self.links: list[str] = []
        self.text, self.source = "", source
        self.feed(source)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        found = dict(attrs)
        if found.get("http-equiv") == "Content-Security-Policy":
            self.policies.append(found["content"] or "")
        self.links += [
            v or ""
            for name, v in attrs
            if name in ("src", "href", "action", "data", "srcset")
        ]

    def handle_data(self, data: str) -> None:
        self.text += data


def hashes(source: str) -> list[str]:
    """Of the scripts of a page that are run: its own, and the library that it
    unpacks."""
    (own,) = re.findall(r"<script>(.*?)</script>", source, re.DOTALL)
    (packed,) = re.findall(
        r'<script type="text/plain" id="library">(.*?)</script>', source
    )
    scripts = own.encode(), gzip.decompress(base64.b64decode(packed))
    return [
        base64.b64encode(hashlib.sha256(script).digest()).decode() for script in scripts
    ]


def files(path: Path) -> dict[str, bytes]:
    return {
        str(p.relative_to(path)): p.read_bytes()
        for p in sorted(path.rglob("*"))
        if p.is_file()
    }


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
    assert {
        "report.html",
        "tables/parameters.csv",
        "tables/verdict.csv",
        "history.csv",
    } <= set(before)


def test_every_chart_becomes_a_figure_well_formed_and_undated(written, tmp_path: Path):
    files = write_figures(fit_page(written[-1]), tmp_path)
    search = {"learning", "pareto"}
    known = {"priors", "correlation", "speed_1", "residual_1"}
    assert {file.stem for file in files} == {"response_1", *search, *known}
    for file in files[1::2]:
        ElementTree.fromstring(file.read_bytes())
        assert b"dc:date" not in file.read_bytes()


def test_history_and_front_come_back_to_the_last_bit(written):
    path, problem, fit, _ = written
    header, *rows = csv.reader((path / "history.csv").read_text().splitlines())
    assert tuple(header) == HISTORY
    assert np.array_equal(np.array(rows, dtype=float), fit.history)
    header, *rows = csv.reader((path / "pareto.csv").read_text().splitlines())
    assert header == [
        *problem.parameters.names,
        *(f"segment_{s}_rad" for s in range(1, 5)),
        "overall_rad",
    ]
    expected = np.column_stack(fit.front)
    assert np.array_equal(np.array(rows, dtype=float), expected)


def test_the_page_loads_nothing_from_elsewhere_and_a_name_is_text(written):
    source = (written[0] / "report.html").read_text(encoding="utf-8")
    page = Reader(source)
    # they lead to sections of the page itself
    sections = re.findall(r'id="(section-\d+)"', source)
    assert set(page.links) <= {f"#{name}" for name in sections}
    assert len(sections) == len(set(sections))
    # what would load or run all the same is refused by the browser
    (policy,) = page.policies
    allowed = dict(rule.split(" ", 1) for rule in policy.split("; "))
    assert allowed == {
        "default-src": "'none'",
        "script-src": " ".join(f"'sha256-{one}'" for one in hashes(source)),
        "style-src": "'unsafe-inline'",
        "img-src": "data:",
        "base-uri": "'none'",
        "form-action": "'none'",
    }
    own = re.sub(r'<script type="text/plain".*?</script>', "", source, flags=re.DOTALL)
    assert not re.search(
        r"https?://(?!www\.w3\.org/2000/svg)|@import|url\(|fetch\(", own
    )
    assert not {"link", "iframe", "object"} & set(page.tags)
    assert len(source) < 2e6
    assert HOSTILE in page.text  # a name is text
    assert "<b>&_" not in re.sub(r"<script.*?</script>", "", source, flags=re.DOTALL)


def test_a_fit_that_did_not_converge_says_so(written):
    _, problem, fit, _ = written
    ending = next(e for e in type(fit.refinement.ending) if not e.converged)
    fit = replace(fit, refinements={"refined": replace(fit.refinement, ending=ending)})
    assert ending.value in fit_page(make_record(problem, fit)).warnings[0]


def test_the_verdict_comes_first_and_is_not_tested_until_a_log_is_unseen():
    problem = make_problem()
    log, fit = replace(problem.logs[0], source="b.csv"), make_fit(problem)
    page = fit_page(make_record(problem, fit))
    assert [row[1] for row in page.tables["verdict"].rows] == ["? not tested"]
    assert page.lead == "shoulder: not tested."
    page = fit_page(
        make_record(problem, fit, {"b.csv": make_prediction(log, error=0.001)})
    )
    assert page.tables["verdict"].rows[0][1] == "✓ predicts"
    errors = next(
        section for section in page.sections if section.title == "Errors by log"
    )
    assert [(tab.row, tab.column, tab.state) for tab in errors.tabs] == [
        ("b.csv unseen", "shoulder", "good"),
        ("a.csv fitted", "shoulder", "fair"),
    ]


def test_errors_of_a_joint_that_slides_are_in_millimetres():
    problem = make_problem()
    (one,) = judge(
        problem.settings, [], {}, [make_prediction(problem.logs[0], error=0.02)]
    )
    slid = one.changed(
        {
            "slides": True,
            "baselines_deg": {"standing still": 2.0},
            "compared_whole": {
                "standing still": Comparison(outcome=Outcome.BETTER, blocks=4)
            },
            "horizons_deg": {"the fit": (1.0, None, 1.0, 1.0, 1.0)},
        }
    )
    assert {"mm", "20 (35) better"} <= {*verdict_table({"a": [slid]}).rows[0]}
    section = horizon_section({"a": [slid]})
    assert section.tables["horizons"].rows[0][2:5] == ("mm", 17.0, None)


def test_the_verdict_shows_each_time_beside_the_best_simple_model_and_digits_that_tell():
    outcomes = {
        "speed tables": (
            Outcome.BETTER,
            Outcome.BETTER,
            Outcome.BETTER,
            Outcome.BETTER,
            Outcome.WORSE,
        ),
        "nine numbers": (
            Outcome.UNTOLD,
            Outcome.UNTOLD,
            Outcome.UNTOLD,
            Outcome.UNTOLD,
            Outcome.BETTER,
        ),
    }
    one = JointVerdict(
        joint=1,
        name="boom",
        verdict=Verdict.UNTOLD,
        beside="nine numbers",
        fitted_deg=1.0,
        unseen_deg=3.0,
        unseen_logs=2,
        tolerance_deg=1.0,
        baselines_deg={"speed tables": 2.0, "nine numbers": 4.0},
        horizons_deg={
            "the fit": (0.1, 0.52, 0.7, 2.91, None),
            "speed tables": (0.2, 0.9, 1.0, 4.0, 5.0),
            "nine numbers": (0.2, 0.6, 1.0, 2.88, 6.0),
        },
        compared={
            name: tuple(Comparison(outcome=o, blocks=9) for o in some)
            for name, some in outcomes.items()
        },
        compared_whole={name: Comparison(outcome=Outcome.UNTOLD) for name in outcomes},
    )
    table = verdict_table({"a": [one]})
    row = dict(zip(table.header, table.shown[0], strict=True))
    assert row == {
        "joint": "boom",
        "verdict": "? cannot be told from nine numbers",
        "1 s": "0.52 (0.60) cannot be told",
        "5 s": "2.91 (2.88) cannot be told",
        "10 s": "diverged (5)",
        "whole logs": "3.0 (2.0)",  # two logs tell nothing
        "whole fitted logs": "1",
        "allowed error": "1",
    }
    assert "Allowed error: over whole logs" in table.note
    # the page also says by which rule; of the verdicts that it shows alone
    section = verdict_sections({"a": [one]}, ())[0]
    note = section.tables["verdict"].note
    assert note.startswith(
        "Cannot be told: after 1, 5 and 10 s neither better nor worse"
    )
    assert "Predicts roughly" not in note
    # nothing of marks that differ, where there is one
    assert "✗ and !" not in note
    marks = {
        verdict: one.model_copy(update={"verdict": verdict})
        for verdict in (Verdict.ROUGHLY, Verdict.WORSE_THAN_FITTED)
    }
    section = verdict_sections({"a": [*marks.values()]}, ())[0]
    assert "✗ and ! say which rule holds" in section.tables["verdict"].note
    assert lead({"a": [one]}).startswith(
        "boom: cannot be told from nine numbers (2 unseen logs)"
    )


@pytest.mark.parametrize(
    ("about", "words", "command"),
    [
        ({"stage": "mech"}, ("predicts",), "fit-hyd a.csv --mech 'a b'"),
        (
            {"ending": "its time was up"},
            (),
            "fit-hyd a.csv --config 'a b'/config.yaml --out 'a b' --resume",
        ),
        ({}, ("predicts", "not tested"), "validate OTHER.csv --fit 'a b'"),
        ({}, ("predicts", "predicts"), "follow TRAJECTORY.csv --fit 'a b'"),
        ({}, ("predicts", "does not fit"), "suggest --fit 'a b'"),
        ({}, ("predicts", "cannot be told"), "validate OTHER.csv --fit 'a b'"),
        ({}, ("does not fit", "cannot be told"), "suggest --fit 'a b'"),
    ],
)
def test_what_to_do_next_follows_from_the_verdicts(about, words, command):
    verdicts = [
        JointVerdict(joint=1, name="boom", verdict=Verdict(word), tolerance_deg=1)
        for word in words
    ]
    summary, (log,) = (
        FitSummary(**{"stage": "hyd", "estimate": {}} | about),
        make_problem().logs,
    )
    step = next_step(summary, verdicts, "a b", [make_prediction(log)])
    assert step.numbers == {"command": f"hydroid {command}"}


def test_the_worst_joint_is_that_which_errs_most_for_its_tolerance():
    boom, swing = (
        JointVerdict(
            joint=1,
            name=name,
            verdict=Verdict.ROUGHLY,
            unseen_deg=e,
            unseen_logs=1,
            tolerance_deg=good,
            baselines_deg={"nine numbers": 2.04},
        )
        for name, e, good in (("boom", 2.0, 1.0), ("swing", 3.0, 4.0))
    )
    said = worst([swing, boom])
    assert said.startswith(
        "Furthest beyond its allowed error: boom, 2.00 deg (allowed 1, "
    )
    # one log does not tell which of both errs less
    chance = "The best simple model errs by 2.04 deg; the difference may be chance."
    assert said.endswith(chance)
    told = Comparison(outcome=Outcome.WORSE, blocks=4)
    worse = boom.changed(
        {
            "unseen_deg": 2.5,
            "unseen_logs": 4,
            "compared_whole": {"nine numbers": told},
        }
    )
    assert worst([swing, worse]).endswith("A simple model errs by less: 2.0 deg.")
    untold = told.changed({"outcome": Outcome.UNTOLD})
    unclear = worse.changed({"compared_whole": {"nine numbers": untold}})
    assert worst([swing, unclear]).endswith("the difference may be chance.")
    # errors on fitted logs are not compared
    own = boom.changed({"unseen_logs": 0, "unseen_deg": None, "fitted_deg": 2.0})
    assert "chance" not in worst([swing, own])
    assert not worst([boom])
    diverged = boom.changed({"unseen_deg": None, "fitted_deg": 0.1})
    assert (
        worst([swing, diverged])
        == "Furthest beyond its allowed error: boom, whose simulation diverges."
    )
    assert worst([swing, diverged.changed({"unseen_logs": 0})]).startswith(
        "Nearest to its allowed error: swing"
    )


def test_a_fit_that_fails_says_so_in_every_place():
    problem = make_problem()
    log, fit = problem.logs[0], make_fit(problem)
    unseen = {
        name: make_prediction(replace(log, source=name), error=1.0)
        for name in ("b", "c", "d", "e")
    }
    page = fit_page(make_record(problem, fit, unseen))
    text = Reader(html(page)).text
    assert "✗ predicts no better than standing still" in text
    assert "✓" not in text
    assert (
        page.lead == "shoulder: predicts no better than standing still (4 unseen logs)."
    )


def test_a_validation_of_several_fits_shows_the_best_first_in_shared_charts():
    problem = make_problem()
    settings, log = problem.settings, problem.logs[0]
    predictions = [
        make_prediction(log, fit=name, error=e)
        for name, e in (("bad", 0.2), ("good", 0.001))
    ]
    fits = ordered({p.fit: judge(settings, [], {}, [p]) for p in predictions})
    assert list(fits) == ["good", "bad"]
    page = validation_page(predictions, fits, settings.arm)
    assert page.lead == "good is best. shoulder: predicts (1 unseen log)."
    (tab,) = next(
        section for section in page.sections if section.title == "Response"
    ).tabs
    labels = {mark.label for panel in tab.make().panels for mark in panel.marks}
    assert {label.partition(" (")[0] for label in labels} >= {"good", "bad", "measured"}


def test_a_joint_that_only_a_later_fit_compares_is_shown():
    problem = make_problem(outputs=(2, 3))
    settings, log = problem.settings, problem.logs[0]
    of_two = make_prediction(log, (2, 3), fit="two", error=0.2)
    of_one = make_prediction(log, (2,), fit="one", error=0.001)
    judged = {
        "one": judge(settings.changed({"outputs": (2,)}), [], {}, [of_one]),
        "two": judge(settings, [], {}, [of_two]),
    }
    page = validation_page([of_one, of_two], ordered(judged), settings.arm)
    (tabs,) = [
        section.tabs for section in page.sections if section.title == "Errors by log"
    ]
    size = f"{np.degrees(0.2):.2g}°"
    assert [(tab.column, tab.button, tab.state) for tab in tabs] == [
        ("shoulder", f"{np.degrees(0.001):.2g}°", "good"),
        ("elbow", size, "bad"),
        ("joints", "all", "bad"),
    ]
    labels = {
        mark.label.partition(" (")[0]
        for panel in tabs[1].make().panels
        for mark in panel.marks
    }
    assert "two" in labels
    assert "one" not in labels


def test_the_best_fit_is_found_by_the_joints_that_all_compare():
    boom, swing = (
        JointVerdict(
            joint=j,
            name=str(j),
            verdict=Verdict.ROUGHLY,
            unseen_deg=e,
            unseen_logs=1,
            tolerance_deg=1.0,
        )
        for j, e in ((1, 2.0), (2, 3.0))
    )
    better = boom.changed({"unseen_deg": 1.0})
    assert [*ordered({"only boom": [boom], "both": [better, swing]})] == [
        "both",
        "only boom",
    ]
    # none is shared
    assert [*ordered({"swing": [swing], "boom": [boom]})] == ["boom", "swing"]


def test_a_joint_may_be_called_as_a_column():
    arm = make_problem().settings.arm
    rows = [{"parameter": "P_flow", "left_out_deg": {"parameter": 1.5, "boom": None}}]
    table = left_out_table("", {"parameter": "freed"}, rows, arm)
    assert table.header == ("freed", "parameter", "boom")
    assert table.shown == [["P_flow", "1.5", ""]]


def test_a_table_of_any_name_stays_in_its_folder(tmp_path: Path):
    cells = Table("", ("a",), ((1,),))
    names = ("known_../../../out", "known_a/b", "known_a_b", "known_A_b", "x" * 300)
    write_tables(dict.fromkeys(names, cells), tmp_path / "run" / "here")
    assert len(list((tmp_path / "run" / "here" / "tables").glob("*.csv"))) == len(names)
    assert [path.name for path in tmp_path.iterdir()] == ["run"]
    assert [path.name for path in (tmp_path / "run").iterdir()] == ["here"]


def test_a_folder_that_cannot_be_written_is_said(tmp_path: Path):
    (tmp_path / "tables").write_text("in the way")
    page = Page(
        "p", "t", "l", (Section("s", tables={"t": Table("t", ("a",), ((1,),))}),), ()
    )
    with pytest.raises(RunError, match="cannot be written"):
        write_page(page, tmp_path)


def test_a_page_opens_on_the_first_log_whose_arm_it_shows_in_motion():
    tabs = [Plot("", "", dict, row=row) for row in ("a", "a", "b", "c")]
    assert Section("", tabs=tuple(tabs)).chosen == tabs[0]
    beside = tuple(Plot("", "", dict, row=row) for row in ("c", "b"))
    assert Section("", tabs=tuple(tabs), beside=beside).chosen == tabs[2]
    assert Section("").chosen is None


def test_the_verdict_says_how_long_the_unseen_logs_are():
    first, second = make_problem(outputs=(2,), samples=400, sources=("a", "b")).logs
    seen = [make_prediction(first), make_prediction(second.part(0, 200))]
    one = JointVerdict(
        joint=2,
        name="shoulder",
        verdict=Verdict.PREDICTS,
        unseen_logs=2,
        unseen_deg=0.1,
        tolerance_deg=1.0,
    )
    verdicts = {"a": [one]}
    note = verdict_sections(verdicts, seen)[0].tables["verdict"].note
    assert "on 2 unseen logs of 2 to 4 s, which the fit did not use" in note
    apart = replace(seen[1], apart=True)
    note = verdict_sections(verdicts, [seen[0], apart])[0].tables["verdict"].note
    assert "unseen logs of 4 s, which" in note
