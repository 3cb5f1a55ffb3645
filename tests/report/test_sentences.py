"""Sentences whose words depend on numbers: what an action brings, and whether an error is as expected."""

import numpy as np
import pytest
import yaml
from report_fits import make_problem

from hydroid import load_settings
from hydroid.advice.actions import Action, ActionKind
from hydroid.advice.missing import TermTest, Verdict
from hydroid.advice.terms import Term
from hydroid.fitting.validation import error_indices
from hydroid.posterior.band import Band
from hydroid.report.suggestion_report import action_effect, freeing_command, setting_line
from hydroid.report.validation_report import Validation, validation_page
from hydroid.settings.load import parse_override


def test_an_action_names_what_improves_beside_what_it_states():
    action = Action(ActionKind.STATE, "D", 8, (7, 8), "C", (0.015, 0.011), 1.2, "dead time", (0.2, 0.1))
    assert action_effect(action) == (
        "Besides D itself, C improves most: standard deviation 1.5 % to 1.1 %. Of the "
        "quantities, dead time improves most: standard deviation 20 % to 10 %"
    )


@pytest.mark.parametrize(
    ("inside", "error", "words"),
    [
        (0.96, 0.01, "96 % of the samples lie inside the band: the error (0.57°) is no larger than"),
        (0.94, 0.03, "the error (1.7°) is not clearly larger than the fitted logs lead to expect (1.1°)"),
        (
            0.5,
            0.2,
            "The error (11°) is clearly larger than the fitted logs lead to expect (1.1°; by",
        ),
    ],
)
def test_a_validation_says_whether_the_error_is_as_expected(inside: float, error: float, words: str):
    log = make_problem().logs[0]
    band = Band(0.015, np.full(len(log.time), 0.04), inside, error, 0.02, 0.035)
    indices = {2: error_indices(log.angle[:, 1], log.angle[:, 1] + error)}
    page = validation_page([Validation("hyd", log, log.angle[:, [1]] + error, indices, {2: band}, False)])
    assert words in page.sections[1].points[0]
    state = {light.question: light.state for light in page.verdict.lights}
    assert state["As the fitted logs lead to expect"] == ("fair" if inside < 0.9 else "good")


def test_the_command_that_frees_a_held_mass_gives_settings_that_need_no_stage_1():
    held = load_settings("fit-hyd").parameters["M3"]
    free = held.model_copy(update={"fixed": None, "bounds": (5.0, 80.0)})
    test = TermTest(Term("M3", free, 21.17, named=True), Verdict.FREE, 9.0, 0.0, 0.001, 25.0)
    assert setting_line(test).endswith("start: 21.17}")
    command = freeing_command(make_problem(("a b.csv",)), test, "runs/my fit")
    assert "'a b.csv' --config 'runs/my fit/config.yaml' --from 'runs/my fit' --set 'param" in command
    assert command.endswith(" --out 'runs/my fit-M3'")
    key, value = parse_override(command.split("--set '")[1].split("'")[0])
    assert (key, value) == ("parameters.M3", yaml.safe_load(setting_line(test))["M3"])
    assert load_settings("fit-hyd", {key: value}).parameters["M3"].states_start
