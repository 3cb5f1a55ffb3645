"""Statements that figures are judged by, on records whose answer is known."""

from pathlib import Path

import numpy as np
import pytest
from small_studies import run, written

from hydroid.errors import SettingsError
from hydroid.study.claims import Outcome
from hydroid.study.findings import FOLLOWS, local_minima, turning_points


def test_peaks_and_troughs_of_a_sine_are_counted_without_its_ripple():
    time = np.linspace(0, 4, 4001)
    assert turning_points(np.sin(2 * np.pi * time) + 0.02 * np.sin(200 * time)) == 8


def test_minima_of_two_valleys_are_two():
    x, y = np.meshgrid(np.linspace(-2, 2, 21), np.linspace(-1, 1, 11), indexing="ij")
    assert local_minima((x**2 - 1) ** 2 + y**2) == 2
    assert local_minima(x**2 + y**2) == 1


def test_each_kind_of_figure_judges_its_statement(tmp_path: Path):
    figures = [
        {
            "title": "Figure 9: arm",
            "kind": "arm",
            "actuators": {"linear": 5, "rotary": 2},
            "says": "five and two",
        },
        {"title": "arm", "kind": "arm", "actuators": {"linear": 7}, "says": "seven"},
        {"title": "f", "kind": "flow chart", "says": "the loop"},
        {"title": "c", "kind": "commands", "says": "inside"},
        {"title": "s", "kind": "segments", "says": "as many"},
        {"title": "r", "kind": "responses", "says": "follows", "cells": ["mean"]},
        {"title": "order", "kind": "sensitivity", "orders": {"D before M1": [["D", "S"], ["M1"]]}},
        {"title": "reverse", "kind": "sensitivity", "orders": {"M1 before D": [["M1"], ["D"]]}},
        {"title": "drawn only", "kind": "commands"},
    ]
    found = run(written(tmp_path, figures=figures, seeds=1), tmp_path)
    outcomes = {verdict.says: verdict.outcome for verdict in found.findings}
    assert len(outcomes) == len(figures) - 1
    sure = ("five and two", "the loop", "inside", "D before M1")
    assert all(outcomes[says] is Outcome.CONFIRMED for says in sure)
    assert outcomes["seven"] is Outcome.OPEN
    assert outcomes["M1 before D"] is Outcome.CONTRADICTED
    assert found.findings[0].item == "figure 9"
    (error,) = [row.values["rms error"] for row in found.rows if row.cell == "mean"]
    follows = error <= FOLLOWS * np.ptp(np.degrees(found.problem.logs[0].angle[:, 1]))
    assert (outcomes["follows"] is Outcome.CONFIRMED) == follows


def test_a_statement_of_a_figure_that_cannot_judge_is_refused(tmp_path: Path):
    figures = [{"title": "f", "kind": "spread", "says": "lower"}]
    with pytest.raises(SettingsError, match="kind spread judges no statement; give it as a claim"):
        run(written(tmp_path, figures=figures), tmp_path)
