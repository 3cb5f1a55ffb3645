"""What the report of a fit says, section by section."""

from collections.abc import Mapping
from typing import Any

from hydroid.fitting.fit import Fit
from hydroid.problem.problem import Problem
from hydroid.report.channels import channels
from hydroid.report.html import Picture, Section, report_html
from hydroid.report.identifiability import told_section
from hydroid.report.table import Table, number
from hydroid.report.words import cautions, norm_label, summary, told
from hydroid.settings.problem import PriorSettings

_ALGORITHMS = {
    "ga": "simple genetic algorithm",
    "nsga2": "NSGA-II, a multi-objective genetic algorithm",
    "cmaes": "CMA-ES, an evolution strategy",
    "multistart": "bounded least squares from random starts",
}
_STAGES = {
    "mech": "1, the arm: a gain stands for the hydraulics",
    "hyd": "2, the hydraulic actuator",
}
_PARETO = {
    "single": "The search minimises the error over the whole record and does not look for this set: these "
    "are merely the sets of its last population that no other beats in every segment.",
    "several": "What the search was after: to fit one segment better than one of these does costs another.",
}
_CAPTIONS = {
    "estimates": "Every estimate between its bounds. Grey: held fixed, or without effect.",
    "learning": "Best parameter set so far, and the median of each population.",
    "pareto": "Each line is one parameter set that no other beats in every segment.",
}


def fit_page(
    arm: str,
    identity: Mapping[str, Any],
    problem: Problem,
    fit: Fit,
    tables: Mapping[str, Table],
    figures: Mapping[str, bytes],
) -> str:
    """Return report.html.

    Args:
        arm: name of the arm.
        identity: the run's versions, seed and log hashes.
        problem: the problem.
        fit: what was found.
        tables: `parameters` and `errors`.
        figures: SVG by name; those called response... are the responses.
    """
    responses = [name for name in figures if name.startswith("response")]
    left_out = len(channels(problem)) - len(responses)
    rest = "response is" if left_out == 1 else "responses are"
    more = f" {left_out} further {rest} not drawn; the table lists all errors." if left_out > 0 else ""
    sections = (
        Section("What was fitted", facts=_facts(arm, identity, problem)),
        Section("The answer", tables=(tables["parameters"],), pictures=_pictures(figures, "estimates")),
        Section(
            "How well it fits",
            "Judge a fit also on a log that it has not seen: the command hydroid validate does that." + more,
            tables=(tables["errors"],),
            pictures=tuple(Picture(figures[name], _RESPONSE) for name in responses),
        ),
        told_section(told(fit), problem, fit.uncertainty, fit.identifiability, figures),
        Section("How the search went", facts=_effort(fit), pictures=_pictures(figures, "learning")),
        Section(
            "The Pareto set",
            _PARETO[_objectives(problem, fit)],
            pictures=_pictures(figures, "pareto"),
        ),
        Section("What to beware of", points=cautions(problem, fit)),
    )
    versions = {
        key: str(identity[key]) for key in ("hydroid", "mujoco", "numpy", "python") if key in identity
    }
    return report_html(f"Parameters of {arm}", summary(fit), sections, versions)


_RESPONSE = (
    "Above: measured and simulated angle, segments numbered. Middle: what is left over. Below: the command."
)


def _pictures(figures: Mapping[str, bytes], name: str) -> tuple[Picture, ...]:
    return (Picture(figures[name], _CAPTIONS[name]),) if name in figures else ()


def _facts(arm: str, identity: Mapping[str, Any], problem: Problem) -> tuple[tuple[str, str], ...]:
    settings = problem.settings
    hashes = list(identity.get("logs", {}).values())
    logs: list[tuple[str, str]] = []
    for channel in channels(problem):
        i, k = channel.index
        if k == 0:
            seconds = len(channel.time) * problem.logs[i].period
            digest = f", SHA-256 {hashes[i][:12]}…" if i < len(hashes) else ""
            label = "log" if len(problem.logs) == 1 else f"log {i + 1}"
            logs.append((label, f"{channel.log}, {number(seconds)} s, {len(channel.time)} samples{digest}"))
    return (
        ("arm", arm),
        ("stage", _STAGES[settings.stage]),
        *logs,
        *((f"in the gripper, {name}", f"{number(mass)} kg") for name, mass in settings.payloads.items()),
        *((f"known: {name}", _statement(s)) for name, s in settings.priors.items()),
        ("compared", f"measured angle of joint {', '.join(str(j) for j in settings.outputs)}"),
        ("other joints", settings.simulation.other_joints),
        ("objective", f"{norm_label(settings.objective)}, {len(problem.bounds)} segments"),
        ("search", _ALGORITHMS.get(settings.search.name, f"{settings.search.name}, of pymoo")),
        ("seed", str(settings.search.seed)),
    )


def _statement(known: PriorSettings) -> str:
    """A statement in words."""
    if known.ratio is not None:
        what = " / ".join(known.ratio)
    else:
        terms = (n if f == 1 else f"{number(f)} {n}" for n, f in known.factors.items())
        what = " + ".join(terms).replace("+ -", "- ")
    return f"{what} = {number(known.value)}" + (
        ", exact" if known.sd is None else f" ± {number(known.sd)} (sd)"
    )


def _objectives(problem: Problem, fit: Fit) -> str:
    """Which objectives the search had; of a library's algorithm the estimates tell it."""
    algorithm = problem.settings.search.algorithm
    several = "average" in fit.estimates if algorithm == "pymoo" else algorithm == "nsga2"
    return "several" if several else "single"


def _effort(fit: Fit) -> tuple[tuple[str, str], ...]:
    facts: list[tuple[str, str]] = []
    if len(fit.history):
        generations, evaluations, simulated, infeasible = (int(v) for v in fit.history[-1, :4])
        facts += [
            ("generations", f"{generations}"),
            ("evaluations", f"{evaluations:,}, of which {simulated:,} had to be simulated"),
            ("diverged", f"{infeasible:,}"),
        ]
    if fit.refinement is not None:
        refinement = fit.refinement
        facts.append(
            (
                "refinement",
                f"{refinement.iterations} iterations, {refinement.evaluations:,} simulations: {refinement.ending.value}",
            )
        )
    return tuple(facts)
