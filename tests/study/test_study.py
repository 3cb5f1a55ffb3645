"""The study's mechanism: each run is one file, what is there is not repeated, what failed is shown."""

import json
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from small_studies import TRUTH, content, run, written

from hydroid import read_logs
from hydroid.errors import RunError, SettingsError
from hydroid.report.study_report import study_page
from hydroid.study import execution
from hydroid.study.measures import generations_to_converge
from hydroid.study.study import plan_study


def stored(folder: Path) -> dict[str, dict[str, Any]]:
    """Results by file, without the time that they took."""
    found = {file.name: json.loads(file.read_text()) for file in sorted((folder / "runs").glob("*.json"))}
    for result in found.values():
        result.pop("seconds", None)
    return found


def test_what_is_there_is_read_and_what_is_missing_is_performed(tmp_path: Path, monkeypatch):
    file = written(tmp_path)
    first = run(file, tmp_path)
    assert len(first.rows) == 4
    before = stored(tmp_path)
    assert len(before) == 4
    gone = next((tmp_path / "runs").glob("*.json"))
    gone.unlink()
    performed: list[tuple[str, int]] = []
    perform = execution.perform

    def counted(task):
        performed.append((task.cell, task.seed))
        return perform(task)

    monkeypatch.setattr(execution, "perform", counted)
    again = run(file, tmp_path)
    assert len(performed) == 1
    assert stored(tmp_path) == before
    both = zip(first.rows, again.rows, strict=True)
    assert all(a.values[n] == b.values[n] for a, b in both for n in a.values if n != "seconds")


def test_studies_share_the_runs_that_they_have_in_common(tmp_path: Path):
    run(written(tmp_path), tmp_path)
    files = set(stored(tmp_path))
    other = {"alone": {"one": {"objective.norm": "inf", "search.nsga2.population": 10}}}
    run(written(tmp_path, axes=other, claims=[], tables=[]), tmp_path)
    assert set(stored(tmp_path)) == files  # the unused search's settings decide nothing


def test_a_run_is_the_same_wherever_the_arm_s_files_lie(tmp_path: Path):
    """A checkout that is moved keeps its runs: paths decide nothing."""
    plan = plan_study(written(tmp_path), lambda paths, settings: read_logs(paths, settings))
    task = plan.tasks[0]
    arm, pair = task.settings.arm, task.settings.arm.pair
    assert pair is not None
    elsewhere = tmp_path / "other.xml"
    moved = arm.model_copy(update={"pair": pair.model_copy(update={"model": elsewhere})})
    other = replace(task, settings=task.settings.model_copy(update={"arm": moved}))
    assert other.key() == task.key()


def test_a_study_that_goes_on_says_so_and_records_the_code_of_each_run(tmp_path: Path, caplog):
    caplog.set_level("INFO", "hydroid")
    file = written(tmp_path)
    run(file, tmp_path, seeds=1)
    assert "found" not in caplog.text
    run(file, tmp_path, seeds=2)
    assert "2 of 4 runs found, goes on" in caplog.text
    for result in stored(tmp_path).values():
        assert result["code"].startswith(version("hydroid"))


def test_more_seeds_add_runs(tmp_path: Path):
    file = written(tmp_path, axes={"objective.norm": ["inf"]}, claims=[], tables=[])
    one = run(file, tmp_path, seeds=1)
    two = run(file, tmp_path, seeds=2)
    assert [row.seed for row in two.rows] == [1, 2]
    assert two.rows[0].values == one.rows[0].values


def test_a_run_that_fails_is_shown_and_the_others_count(tmp_path: Path, monkeypatch):
    perform = execution.perform

    def failing(task):
        if (task.cell, task.seed) == ("mean", 2):
            raise RunError("every candidate diverged")
        if (task.cell, task.seed) == ("mean", 1):
            raise MemoryError("for now")
        return perform(task)

    monkeypatch.setattr(execution, "perform", failing)
    found = run(written(tmp_path), tmp_path)
    page = study_page(found)
    assert list(page.tables["failed"].rows) == [
        ("mean", 1, "MemoryError: for now"),
        ("mean", 2, "every candidate diverged"),
    ]
    assert "2 of 4 runs failed" in " ".join(page.warnings)
    counts = {row[0]: row[2] for row in page.tables["errors"].rows if row[1] == "ours"}
    assert counts == {"largest": "2", "mean": "0 of 2"}
    assert len(stored(tmp_path)) == 3  # what may pass is tried again
    monkeypatch.setattr(execution, "perform", perform)
    assert [row.failed for row in run(written(tmp_path), tmp_path).rows].count("") == 3


def test_a_damaged_result_is_refused_in_one_line(tmp_path: Path):
    file = written(tmp_path, axes={"objective.norm": ["inf"]}, seeds=1, claims=[], tables=[])
    run(file, tmp_path)
    (result,) = (tmp_path / "runs").glob("*.json")
    for text in ("{", "[]", '{"other": 1}'):
        result.write_text(text)
        with pytest.raises(RunError, match="remove it"):
            run(file, tmp_path)


def test_errors_at_the_truth_are_zero_and_a_common_scale_is_no_identifiable_error(tmp_path: Path):
    found = run(written(tmp_path, seeds=1), tmp_path)
    known = found.directions
    assert known is not None
    assert known.names == tuple(TRUTH)
    assert np.allclose(known.axes @ known.axes.T, np.eye(9))
    assert np.all(np.diff(known.relative_sd) >= 0)
    # all nine times 1.5: the article's sum is 4.5, and next to nothing of it can be seen in the data
    scaled = known.determined(np.full(9, 0.5))
    assert np.abs(scaled).sum() < 0.1 * 4.5
    for row in found.rows:
        errors = [row.values[f"error {name}"] for name in TRUTH]
        assert row.values["parameter error"] == pytest.approx(sum(errors))
        masses = [row.values[f"value M{i}"] for i in range(1, 7)]
        assert row.values["mass error"] == pytest.approx(abs(sum(masses) - 42.5))
        assert row.values["mean squared error"] == pytest.approx(row.values["rms error"] ** 2)
        assert row.values["mean absolute error"] <= row.values["rms error"] <= row.values["largest error"]


def test_a_search_has_converged_when_a_twentieth_of_the_descent_is_left():
    assert (
        generations_to_converge([[1, 6, None], [2, 9, 11.0], [3, 12, 1.6], [4, 15, 1.5], [5, 18, 1.0]]) == 4
    )
    assert generations_to_converge([[1, 6, 2.0]]) == 1


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"axes": {"norm": {"a": {"objective.nrm": 1}}}}, r"small.yaml, line \d+: .*objective.nrm.*'norm'"),
        ({"set": {"search.ga.population": 1}}, r"small.yaml, line \d+: .*must be at least 2"),
        (
            {"figures": [{"title": "f", "kind": "spread", "cells": ["other"]}]},
            r"small.yaml, line \d+: figures.0.cells: no cell 'other'; the cells: largest, mean",
        ),
        ({"axes": {"objective.norm": []}}, r"axes give 0 cells"),
        ({"sedes": 3}, r"unknown setting 'sedes'; did you mean 'seeds'"),
        ({"base": "nowhere"}, r"nowhere: no such config; give a YAML file or one of: .*article-mech"),
        ({"data": {"truth": TRUTH}}, r"give either simulated"),
        ({"data": {"simulated": {}}}, r"need a truth"),
        ({"data": {"truth": {"K": 1.0}, "simulated": {}}}, r"data.truth: parameter 'D' is missing"),
        ({"data": {"truth": TRUTH, "simulated": {"pose": "sleeping"}}}, r"sleeping"),
        ({"tables": [{"title": "t", "columns": ["beauty"]}]}, r"no measure 'beauty'; known: objective"),
        (
            {"figures": [{"title": "f", "kind": "sensitivity", "orders": {"s": [["K"], ["L"]]}}]},
            r"figures.0: no parameter 'L'; known: K, D, S, M1",
        ),
        ({"figures": [{"title": "f", "kind": "pie"}]}, r"figures.0.kind: must be 'convergence'"),
        (
            {"tables": [{"title": "t", "columns": ["seconds"], "article": {"mean": [1, 2]}}]},
            r"needs 1 values, one for each column, not 2",
        ),
    ],
)
def test_a_bad_file_is_refused_in_one_line(tmp_path: Path, change: dict[str, Any], message: str):
    file = written(tmp_path, **({"tables": [], "claims": []} | change))
    with pytest.raises(SettingsError, match=message) as error:
        plan_study(file, lambda paths, settings: read_logs(paths, settings))
    assert "\n" not in str(error.value)


def test_axes_multiply_and_lists_name_their_cells(tmp_path: Path):
    axes = {"search.ga.crossover_rate": [0.4, 0.8], "norm": content()["axes"]["norm"]}
    file = written(tmp_path, axes=axes, tables=[], claims=[])
    plan = plan_study(file, lambda paths, settings: read_logs(paths, settings))
    assert list(plan.cells) == [
        f"search.ga.crossover_rate {r}, {n}" for r in (0.4, 0.8) for n in ("largest", "mean")
    ]
    rates = [s.search.ga.crossover_rate for s in plan.cells.values()]
    assert rates == [0.4, 0.4, 0.8, 0.8]
