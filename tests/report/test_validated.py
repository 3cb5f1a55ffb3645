"""A fit's page with logs that it has not seen."""

from dataclasses import replace
from typing import Any

import pytest
from report_fits import make_fit, make_problem

from hydroid.fitting.validation import error_indices
from hydroid.report.fit_report import fit_page
from hydroid.report.next_steps import PREDICT_UNSEEN
from hydroid.report.page_file import content_html, page_content
from hydroid.report.validated import with_validation
from hydroid.report.validation_report import Validation, validation_page

PROBLEM = make_problem(("fitted.csv",), samples=200)


@pytest.fixture(scope="module")
def fit() -> dict[str, Any]:
    page = fit_page({}, PROBLEM, make_fit(PROBLEM, effects=(1e-3, 1e-3, 0.0, 1e-3)))
    return page_content(page)


def validated(names: dict[str, float], *, fitted: bool = False) -> dict[str, Any]:
    """A validation on logs by name, each with an error [rad]."""
    results = []
    for name, error in names.items():
        log = replace(PROBLEM.logs[0], source=name)
        response = log.angle[:, [1]] + error
        indices = {2: error_indices(log.angle[:, 1], response[:, 0])}
        arm = PROBLEM.settings.arm
        results.append(Validation("fit", log, response, indices, fitted=fitted, arm=arm))
    page = validation_page(results)
    return page_content(page)


def tabs(content: dict[str, Any], title: str) -> dict[str, Any]:
    return {t["name"]: t for s in content["sections"] if s["title"] == title for t in s["tabs"]}


def test_unseen_logs_come_first_and_each_plot_finds_its_own_chart(fit: dict[str, Any]):
    both = with_validation(fit, validated({"new.csv": 0.01}))
    assert list(tabs(both, "Prediction")) == ["new.csv", "fitted.csv"]
    assert list(tabs(both, "The arm in motion")) == ["new.csv", "fitted.csv"]
    for name, tab in tabs(both, "Prediction").items():
        chart = both["charts"][tab["plots"][0]["chart"]]
        assert chart["panels"][0]["title"] == f"Joint 2 in {name}"
    for before, after in zip(fit["sections"], both["sections"], strict=True):
        charts = [fit["charts"][p["chart"]] for p in before["plots"] if "chart" in p]
        assert [both["charts"][p["chart"]] for p in after["plots"] if "chart" in p] == charts
    assert "new.csv" in content_html(both)


def test_the_verdict_tells_the_error_on_unseen_logs(fit: dict[str, Any]):
    both = with_validation(fit, validated({"new.csv": 0.01}))
    assert both["verdict"]["prediction"].startswith("Predicts an unseen log with an error of 0.57° rms.")
    lights = {light["question"]: light for light in both["verdict"]["lights"]}
    assert lights["Validated on unseen logs"]["state"] == "good"
    assert lights["Validated on unseen logs"]["answer"] == "Yes: 0.57° rms on new.csv."
    steps = [step["what"] for section in both["sections"] for step in section["steps"]]
    assert PREDICT_UNSEEN not in steps


def test_logs_add_up_and_the_last_result_of_each_counts(fit: dict[str, Any]):
    one = with_validation(fit, validated({"a.csv": 0.01, "b.csv": 0.01}))
    two = with_validation(one, validated({"b.csv": 0.02}))
    assert list(tabs(two, "Prediction")) == ["a.csv", "b.csv", "fitted.csv"]
    assert two["verdict"]["prediction"].startswith("Predicts 2 unseen logs with an error of 0.91° rms. Repro")
    assert len(two["charts"]) == len(one["charts"]) == len(fit["charts"]) + 2
    assert with_validation(two, validated({"b.csv": 0.02})) == two


def test_a_fitted_log_proves_nothing(fit: dict[str, Any]):
    assert with_validation(fit, validated({"fitted.csv": 0.01}, fitted=True)) == fit
