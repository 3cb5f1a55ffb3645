"""Suggestions: what the model lacks, what the residual shows, what to do next; a page, and sections."""

import math
import shlex
from collections.abc import Sequence
from typing import Any

import numpy as np

from hydroid.advice.actions import STATED_SD, WEIGHED_SD, Action, ActionKind
from hydroid.advice.freeing import SHORT
from hydroid.advice.missing import LEVEL, MIN_GAIN, MissingTerms, TermTest, Verdict
from hydroid.advice.residuals import LONG_S, Binned, Regressor, ResidualCheck
from hydroid.advice.suggest import Suggestions
from hydroid.advice.terms import Term
from hydroid.estimate import finite
from hydroid.problem.problem import Problem
from hydroid.report.page import Page, Section, Step, log_names
from hydroid.report.page import Verdict as Strip
from hydroid.report.residual_chart import UNITS, residual_tabs
from hydroid.report.table import Cell, Table
from hydroid.settings.problem import MECHANICAL_UNITS
from hydroid.words import listed, number, plain

_VERDICTS = {
    Verdict.FREE: "free it",
    Verdict.UNTRIED: "others first",
    Verdict.LEAVE: "no gain: leave it",
    Verdict.INVISIBLE: "the logs cannot tell it from the free parameters",
}
MOST_STEPS = 3
"""steps that a page names first"""
_AROUND = 5.0
"""proposed bounds reach from the proposed value divided by this to the value times this"""


def suggestion_page(problem: Problem, result: Suggestions, source: str, run: str = "RUN") -> Page:
    """Return the page of all suggestions; its tables are `missing_terms`, `next_actions` and `residuals`.

    `source` names the estimate, and `run` is its run folder as a command takes it.
    """
    lead = missing_phrase(result)
    steps = tuple(suggested_steps(problem, result, run)[:MOST_STEPS])
    first = (Section("Do next", steps=steps),) if steps else ()
    verdict = Strip(lead, f"At {source}, where the error is {math.degrees(result.missing.rms):.2g}° rms.")
    sections = (*first, *suggestion_sections(problem, result, run))
    return Page("suggestions", f"What to change next, at {source}", lead, sections, verdict=verdict)


def suggested_steps(problem: Problem, result: Suggestions, run: str = "RUN") -> list[Step]:
    """Return the quantity to free, and the actions, the best first.

    Only `hydroid suggest` says which quantity to free: the quick test of a fit's report sends there.
    """
    free = result.missing.free
    steps = [
        Step(
            f"Free {test.term.name}.",
            f"The rms error is predicted to fall {fall_phrase(result.missing, test)}. "
            "Keep it if the error on an unseen log falls too.",
            freeing_command(problem, test, run),
        )
        for test in free[: int(result.thorough)]
    ]
    if free and not result.thorough:
        steps.append(
            Step(
                "Find what the model lacks.",
                f"A quick test points at {listed([t.term.name for t in free])}. suggest refines each of the "
                "promising ones, and prints the command that frees the best.",
                _suggest_command(problem, run),
            )
        )
    return steps + [
        Step(f"{action_name(problem, action)}.", f"Predicted: {action_effect(action)}.")
        for action in result.actions
    ]


def suggestion_sections(problem: Problem, result: Suggestions, run: str = "RUN") -> tuple[Section, ...]:
    """Return the three sections."""
    seen, several = residual_phrases(problem, result.residuals), len(result.residuals) > 1

    def notes(check: ResidualCheck) -> str:
        return " ".join(residual_phrases(problem, [check])) if several else ""

    more = "" if result.thorough else " hydroid suggest also tests logs, sensors and experiments."
    actions = action_phrases(problem, result.actions)
    return (
        Section(
            "What the model lacks",
            missing_phrase(result),
            points=term_phrases(problem, result, run),
            tables={"missing_terms": missing_table(result.missing)},
        ),
        Section(
            "What the residual shows",
            ("The largest errors first." if several else "")
            if seen
            else "No trend against angle, speed or command.",
            points=() if several else seen,
            tabs=residual_tabs(problem, result.residuals, notes),
            more={"residuals": residual_table(problem, result.residuals)},
        ),
        Section(
            "What each action would bring",
            f"The predicted effect of each action on what is known, the best first.{more}"
            if actions
            else f"No action of those tested would help much.{more}",
            points=actions,
            tables={"next_actions": action_table(result.actions)} if actions else {},
        ),
    )


def missing_phrase(result: Suggestions) -> str:
    """Say in a sentence what the model lacks."""
    missing = result.missing
    if not missing.tests:
        return "Every quantity that could be tested is free already."
    if not missing.free:
        return f"Tested: {len(missing.tests)} quantities that the fit holds. None would lower the error much."
    first = missing.free[0]
    if not result.thorough:
        names = listed([test.term.name for test in missing.free])
        return f"A quick test points at {names}: freeing one of them may lower the error."
    return f"Freeing {first.term.name} would lower the rms error {fall_phrase(missing, first)}: free it."


def term_phrases(problem: Problem, result: Suggestions, run: str = "RUN") -> tuple[str, ...]:
    """Say how to free the best term, and what about the others."""
    free = result.missing.free
    if not free:
        return ()
    if not result.thorough:
        return (
            "Each predicted error is that of the best of a few steps with the quantity freed. "
            f"{_suggest_command(problem, run)} refines the parameters from there, in up to "
            f"{SHORT.iterations} iterations, tests more quantities, and prints the command that frees the "
            "best of them.",
        )
    first, others = free[0], [test.term.name for test in free[1:]]
    said = [f"To free {first.term.name}, run: {freeing_command(problem, first, run)}"]
    if others:
        said.append(
            f"{listed(others)} would also lower the error, but may describe the same error. Free one "
            "quantity at a time, and validate the new fit."
        )
    return tuple(said)


def fall_phrase(missing: MissingTerms, test: TermTest) -> str:
    """Say from which rms error to which freeing a quantity leads."""
    return f"from {number(math.degrees(missing.rms))} to {number(math.degrees(test.rms))} deg"


def _suggest_command(problem: Problem, run: str) -> str:
    return f"hydroid suggest {_given(problem)} --fit {shlex.quote(run)}"


def _given(problem: Problem) -> str:
    """The logs as a command takes them."""
    return " ".join(shlex.quote(log.source) for log in problem.logs)


def freeing_command(problem: Problem, test: TermTest, run: str = "RUN") -> str:
    """Return the command that fits the same logs again from a run's estimate, with a term freed."""
    name, _, parameter = setting_line(test).partition(": ")
    config, own, out = (shlex.quote(path) for path in (f"{run}/config.yaml", run, f"{run}-{name}"))
    return (
        f"hydroid fit-{problem.settings.stage} {_given(problem)} --config {config} --from {own} "
        f"--set {shlex.quote(f'parameters.{name}={parameter}')} --out {out}"
    )


def setting_line(test: TermTest) -> str:
    """Return the parameter that frees a term, as a line of YAML without braces around it.

    Stage 2 asks for a start of every mechanical parameter that no run of stage 1 gives.
    """
    p, (low, high) = test.term.settings, proposed_bounds(test)
    start = "".join(f", {key}: {plain(value)}" for key, value in _proposed_start(test).items())
    where = f"link: {p.link}" if p.link else f"joints: [{', '.join(map(str, p.joints or ()))}]"
    where = "" if p.link is None and p.joints is None else f"{where}, "
    return (
        f"{test.term.name}: {{quantity: {p.quantity}, {where}bounds: [{plain(low)}, {plain(high)}]{start}}}"
    )


def _proposed_start(test: TermTest) -> dict[str, float]:
    """The start value of a mechanical parameter, within the proposed bounds."""
    if test.term.settings.quantity not in MECHANICAL_UNITS:
        return {}
    low, high = proposed_bounds(test)
    return {"start": min(max(test.term.value, low), high)}


def proposed_bounds(test: TermTest) -> tuple[float, float]:
    """Return bounds around the value that the test found, with the present value inside."""
    low, high = test.term.span
    held = test.value if math.isinf(test.term.value) else test.term.value
    least = 0.0 if low == 0 else min(test.value / _AROUND, held)
    most = max(_AROUND * test.value, held)
    return _rounded(max(least, low)), _rounded(min(most, high))


def _rounded(value: float) -> float:
    return float(f"{value:.2g}")


def missing_table(missing: MissingTerms) -> Table:
    """Return one row per tested quantity."""
    rows: list[tuple[Cell, ...]] = []
    for test in missing.tests:
        term, settings = test.term, test.term.settings
        seen = test.verdict is not Verdict.INVISIBLE
        tried = seen and test.value != term.value
        rows.append(
            (
                term.name,
                settings.unit,
                _held(term),
                float(test.value) if tried else None,
                math.degrees(test.rms) if tried else None,
                test.statistic if seen else None,
                _VERDICTS[test.verdict],
            )
        )
    header = ("quantity", "unit", "held at", "freed", "rms [deg]", "score", "verdict")
    free = _VERDICTS[Verdict.FREE]
    note = (
        f"rms without any of them: {number(math.degrees(missing.rms))} deg, with the best start angles where "
        "the start is open. score: how clearly the residual shows the effect, in standard deviations; "
        "effects that the free parameters can reproduce are removed first. "
        f"'{free}' needs two things. (1) If the model lacked nothing, any of these quantities would be "
        f"named in {100 * LEVEL:.0f} % of fits at most. (2) In simulation the rms error falls by "
        f"{100 * MIN_GAIN:.0f} % at least."
    )
    return Table("Quantities that the fit holds", header, tuple(rows), note, ("unit", "score"))


def _held(term: Term) -> Cell:
    return "no limit" if math.isinf(term.value) else float(term.value)


def residual_phrases(problem: Problem, checks: Sequence[ResidualCheck]) -> tuple[str, ...]:
    """Say what each residual shows, where it shows anything."""
    several = len(checks) > 1
    names = log_names(problem.logs)
    said: list[str] = []
    for check in checks:
        place = f"Joint {check.joint} in {names[check.log]}: " if several else ""
        for what, binned in check.binned.items():
            if (clear := binned.clearest(check.rms)) is not None:
                said.append(_capital(f"{place}{_dependence(what, binned, clear)}"))
        if check.correlation_s > LONG_S:
            said.append(
                _capital(
                    f"{place}the error keeps its sign for about {number(check.correlation_s)} s. The noise "
                    "of a sensor is faster: most of this is an error of the model."
                )
            )
        if check.at_stop.any():
            seconds = float(check.at_stop.sum()) * problem.logs[check.log].period
            error = float(np.sqrt(np.mean(check.residual[check.at_stop] ** 2)))
            said.append(
                _capital(
                    f"{place}the joint stands at its stop for {number(seconds)} s, with an rms error of "
                    f"{number(math.degrees(error))} deg there."
                )
            )
    return tuple(said)


def _dependence(what: Regressor, binned: Binned, b: int) -> str:
    factor = 1.0 if what is Regressor.COMMAND else math.degrees(1.0)
    low, high = factor * binned.edges[b], factor * binned.edges[b + 1]
    mean = math.degrees(float(binned.mean[b]))
    side = "larger" if mean > 0 else "smaller"
    return (
        f"the measured angle is {number(abs(mean))} deg {side} than the simulated one on average where the "
        f"{what.value} is {low:.3g} to {high:.3g} {UNITS[what]}."
    ).replace("-", "−")


def _capital(text: str) -> str:
    return text[0].upper() + text[1:]


def residual_table(problem: Problem, checks: Sequence[ResidualCheck]) -> Table:
    """Return one row per compared angle."""
    names = log_names(problem.logs)
    rows = tuple(
        (
            names[check.log],
            check.joint,
            math.degrees(check.rms),
            check.correlation_s,
            float(check.at_stop.sum()) * problem.logs[check.log].period,
        )
        for check in checks
    )
    header = ("log", "joint", "rms [deg]", "correlation time [s]", "at a stop [s]")
    return Table("Residuals", header, rows)


def action_phrases(problem: Problem, actions: Sequence[Action]) -> tuple[str, ...]:
    """Say what each action is and what it would do."""
    return tuple(f"{action_name(problem, action)}: {action_effect(action)}." for action in actions)


def action_name(problem: Problem, action: Action) -> str:
    """Name an action in the imperative."""
    match action.kind:
        case ActionKind.WEIGH:
            link = problem.settings.parameters[action.subject].link
            return f"Weigh {link} to ±{100 * WEIGHED_SD:.0f} % ({action.subject})"
        case ActionKind.STATE:
            return f"State {action.subject} to ±{100 * STATED_SD:.0f} %, from a data sheet or a measurement"
        case ActionKind.MEASURE_JOINT:
            return f"Compare the angle of joint {action.subject} too"
        case ActionKind.MEASURE_PRESSURES:
            return "Log the chamber pressures and compare them"
        case ActionKind.CONSTANT_COMMANDS:
            return f"Add a log of constant commands of {action.subject} % in both directions"
        case ActionKind.PAYLOAD:
            return f"Repeat the logs with {action.subject} kg in the gripper"
        case ActionKind.EXPERIMENT:
            return f"Run the designed experiment of {action.subject} s (hydroid design)"


def action_effect(action: Action) -> str:
    """Say what an action would do."""
    stated = action.kind in (ActionKind.STATE, ActionKind.WEIGH)
    beside = f"Besides {action.subject} itself, " if stated else ""
    parameter = f"{beside}{action.parameter} improves most: {_fall(action.deviations)}"
    quantity = f"Of the quantities, {action.quantity} improves most: {_fall(action.quantity_deviations)}"
    if not action.quantity:
        return parameter
    return quantity if len(set(_percents(action.deviations))) == 1 else f"{parameter}. {quantity}"


def _fall(deviations: tuple[float, float]) -> str:
    before, after = _percents(deviations)
    return f"standard deviation {before} % to {after} %"


def _percents(deviations: tuple[float, float]) -> list[str]:
    return [f"{100 * deviation:.2g}" for deviation in deviations]


def action_table(actions: Sequence[Action]) -> Table:
    """Return one row per action."""
    rows = tuple(
        (
            *(a.kind.value, a.subject),
            *(a.parameter, *(100 * d for d in a.deviations)),
            *((a.quantity, *(100 * d for d in a.quantity_deviations)) if a.quantity else ("", None, None)),
        )
        for a in actions
    )
    header = ("action", "of", "improves most", "from ± [%]", "to ± [%]")
    header += ("quantity", "quantity from ± [%]", "quantity to ± [%]")
    note = (
        "Relative standard deviations, predicted at the estimate with the noise that the residuals show, "
        "assuming ±100 % on each parameter before any log."
    )
    return Table("Predicted effect of each action", header, rows, note)


def suggestion_content(result: Suggestions) -> dict[str, Any]:
    """Return all suggestions as plain values for JSON (docs/json.md)."""
    missing = [
        {
            "name": test.term.name,
            "verdict": test.verdict.value,
            "unit": test.term.settings.unit,
            "held": finite(test.term.value),
            "freed": finite(test.value),
            "rms_deg": math.degrees(test.rms),
            "score": test.statistic,
            "chance": test.chance,
            "parameter": test.term.settings.model_dump(mode="json", exclude_defaults=True)
            | {"bounds": proposed_bounds(test)}
            | _proposed_start(test)
            if test.verdict is Verdict.FREE
            else None,
        }
        for test in result.missing.tests
    ]
    residuals = [
        {
            "log": check.log,
            "joint": check.joint,
            "rms_deg": math.degrees(check.rms),
            "correlation_s": check.correlation_s,
            "at_stop_s": float(check.at_stop.sum() * np.median(np.diff(check.time))),
            "depends_on": [w.value for w, b in check.binned.items() if b.clearest(check.rms) is not None],
        }
        for check in result.residuals
    ]
    actions = [
        {
            "action": action.kind.value,
            "of": action.subject,
            "known_before": action.known[0],
            "known_after": action.known[1],
            "total": action.total,
            "parameter": action.parameter,
            "before_percent": 100 * action.deviations[0],
            "after_percent": 100 * action.deviations[1],
            "quantity": action.quantity or None,
            "quantity_before_percent": 100 * action.quantity_deviations[0] if action.quantity else None,
            "quantity_after_percent": 100 * action.quantity_deviations[1] if action.quantity else None,
        }
        for action in result.actions
    ]
    rms = math.degrees(result.missing.rms)
    return {"rms_deg": rms, "missing": missing, "residuals": residuals, "actions": actions}
