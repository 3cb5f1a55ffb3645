"""Reports drawn anew, and several side by side, from the pages alone."""

import shutil
from dataclasses import replace
from pathlib import Path

import pytest
from report_fits import make_fit, make_problem

import hydroid
from hydroid.errors import RunError
from hydroid.fitting.validation import error_indices
from hydroid.report.fit_report import fit_page
from hydroid.report.page_file import read_page, write_page
from hydroid.report.validation_report import Validation, validation_page

IDENTITY = {"hydroid": "0", "mujoco": "4", "logs": {"a.csv": "f" * 64}}


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Two fits of one log, and a validation of both on that log and on another."""
    root, problem = tmp_path_factory.mktemp("runs"), make_problem()
    for seed in (0, 1):
        write_page(fit_page(IDENTITY, problem, make_fit(problem, seed=seed)), root / f"fit-{seed}")
    log = problem.logs[0]
    results = [
        Validation(
            f"fit-{seed}",
            one,
            one.angle[:, [1]] + error,
            {2: error_indices(one.angle[:, 1], one.angle[:, 1] + error)},
            fitted=one is log,
        )
        for one in (log, replace(log, source="unseen.csv"))
        for seed, error in ((0, 0.02), (1, 0.01))
    ]
    write_page(validation_page(results), root / "validation")
    return [root / name for name in ("fit-0", "fit-1", "validation")]


def test_a_report_is_drawn_anew_to_the_same_bytes(folders: list[Path], tmp_path: Path):
    shutil.copytree(folders[0], tmp_path / "copy")
    page = tmp_path / "copy" / "report.html"
    before = page.read_bytes()
    assert hydroid.report([tmp_path / "copy"]) == page
    assert page.read_bytes() == before


def test_a_validation_leads_with_the_best_fit_on_the_unseen_log(folders: list[Path]):
    content = read_page(folders[2] / "validation.html")
    assert content["verdict"]["prediction"] == "fit-1 predicts an unseen log with an error of 0.57° rms."
    assert content["verdict"]["lights"][0]["state"] == "good"
    tabs = content["sections"][0]["tabs"]
    assert [tab["name"] for tab in tabs] == ["unseen.csv", "a.csv"]
    assert tabs[0]["note"].startswith("Unseen")
    marks = content["charts"][tabs[0]["plots"][0]["chart"]]["panels"][0]["marks"]
    off = {mark["label"].split(" ")[0]: mark["off"] for mark in marks}
    assert off == {"measured": False, "fit-1": False, "fit-0": True}


def test_several_reports_stand_side_by_side(folders: list[Path], tmp_path: Path):
    content = read_page(hydroid.report(folders, tmp_path))
    assert content["lead"] == "fit-1 predicts an unseen log best, with an error of 0.57° rms."
    sections = {section["title"]: section for section in content["sections"]}
    assert [row[0] for row in sections["Verdicts"]["tables"][0]["rows"]] == ["fit-0", "fit-1", "validation"]
    tabs = {tab["name"]: tab for tab in sections["Prediction"]["tabs"]}
    assert set(tabs) == {"a.csv", "unseen.csv"}
    # both fits' final estimates are drawn over one record, each in a colour of its own
    marks = content["charts"][tabs["a.csv"]["plots"][0]["chart"]]["panels"][0]["marks"]
    shown = [mark for mark in marks if not mark["off"] and "refined" in mark["label"]]
    assert [mark["label"].split(":")[0] for mark in shown] == ["fit-0", "fit-1"]
    assert len({mark["color"] for mark in shown}) == 2
    bars = sections["Parameters"]["bars"]
    assert [bar["symbol"] for bar in bars[:3]] == ["K", "", "D"]
    assert all(0 <= bar["at"] <= 1 for bar in bars)
    errors = sections["Prediction"]["tables"][0]["rows"]
    assert ["fit-1 (in validation)", "unseen.csv", "unseen", "0.5730"] in errors


def test_a_folder_without_a_report_is_said(tmp_path: Path):
    with pytest.raises(RunError, match="holds no report"):
        hydroid.report([tmp_path])
    (tmp_path / "report.html").write_text("<p>of another program</p>")
    with pytest.raises(RunError, match="is no report of this version"):
        hydroid.report([tmp_path])
