"""What suggestions propose: findings that change something, and commands that can be
pasted."""

import pytest
from report_fits import make_problem

from hydroid import load_settings
from hydroid.advice.growth import Candidate
from hydroid.advice.suggestions import action_findings, freeing_command, proposed
from hydroid.advice.terms import Term
from hydroid.findings import Finding
from hydroid.reporting.parameters_report import in_words, sentence
from hydroid.settings.load import parse_override


@pytest.mark.parametrize(
    ("after", "expected"),
    [(11.0, "Then C is known to 11 % instead of 15 %."), (15.0, "")],
)
def test_an_action_that_changes_nothing_is_not_shown(after: float, expected: str):
    action = {
        "action": "state",
        "of": "D",
        "parameter": "C",
        "before_percent": 15.0,
        "after_percent": after,
    }
    found = action_findings({"actions": [action]}, make_problem().settings)
    assert " ".join(finding.hint for finding in found) == expected


def test_the_command_that_frees_a_held_mass_gives_settings_that_need_no_stage_1():
    held = load_settings("fit-hyd").parameters["M3"]
    free = held.model_copy(update={"fixed": None, "bounds": (5.0, 80.0)})
    term = Term("M3", {"M3": free}, 21.17)
    entries = proposed(Candidate(term, 25.0, 9.0, 0.0, 0.1), 25.0)
    assert entries["M3"]["start"] == 25.0
    command = freeing_command(make_problem(("a b.csv",)), entries, "runs/my fit")
    assert (
        "'a b.csv' --config 'runs/my fit/config.yaml' --start 'runs/my fit' --set 'param"
        in command
    )
    assert command.endswith(" --out 'runs/my fit-M3'")
    key, value = parse_override(command.split("--set '")[1].split("'")[0])
    assert (key, value) == ("parameters.M3", entries["M3"])
    assert load_settings("fit-hyd", {key: value}).parameters["M3"].states_start


def test_what_to_state_is_named_in_words_with_its_symbol_behind():
    problem = make_problem()
    action = {
        "action": "state",
        "of": "D",
        "parameter": "M1",
        "before_percent": 15.0,
        "after_percent": 3.0,
    }
    (found,) = action_findings({"actions": [action]}, problem.settings)
    assert found.what.startswith("State damping of the joint (D) to ±")
    assert found.hint == "Then mass (link1: M1) is known to 3 % instead of 15 %."


def test_parameters_of_the_same_words_are_named_together():
    settings = make_problem().settings
    some = Finding(
        "strained prior", "warning", ("M1", "K", "M2"), details={"K": "2.9 above"}
    )
    assert in_words(some, settings).subjects == (
        "mass (M1 and M2)",
        "torque per command (K; 2.9 above)",
    )
    other = Finding("log stands out", "warning", ("a.csv",), {"run": "R"})
    assert in_words(other, settings).subjects == ("a.csv",)


def test_a_sentence_begins_with_a_capital_letter_but_not_a_name():
    settings = make_problem().settings
    words = sentence(Finding("at limit", "note", ("D",)), settings)
    assert words == (
        "Damping of the joint (D) is at the upper bound, the largest possible value."
    )
    of_a_log = Finding("log stands out", "note", ("a.csv",), {"run": "r"})
    assert sentence(of_a_log, settings).startswith("a.csv has an error")
