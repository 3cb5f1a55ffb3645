"""Figures of `make demo` and `make excavator` that the pages state: one file, and the
pages' parts from it.

    python docs/figures.py [runs]     # reads the runs, writes docs/figures.yaml and the marked parts of pages
    python docs/figures.py --pages    # writes the marked parts alone, from docs/figures.yaml

A marked part stands between <!--=NAME--> and <!--/-->: NAME is one of PARTS, or leads
to one number of the file by its keys, as rig.shoulder.unseen_deg does. It must not
begin a line within a paragraph.
"""

import re
import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from hydroid.arrays import Array
from hydroid.errors import HydroidError
from hydroid.estimate import FitSummary
from hydroid.files import write_atomic
from hydroid.fitting.baselines import NAMES
from hydroid.fitting.validation import HORIZONS, Prediction
from hydroid.fitting.verdict import JUDGED, THE_FIT
from hydroid.joint_verdict import Outcome
from hydroid.reporting.verdict_table import WHOLE, column_of, verdict_table
from hydroid.run.record import FinishedRun, load_record
from hydroid.words import listed, number

ROOT = Path(__file__).parents[1]
FILE = ROOT / "docs" / "figures.yaml"
PAGES = (
    ROOT / "README.md",
    *sorted((ROOT / "docs").glob("*.md")),
    ROOT / "examples/excavator/README.md",
)
HEAD = "# Written by `make figures` from the runs of `make demo` and `make excavator`; pages state them.\n"
MARKED = re.compile(r"(<!--=([\w. ]+)-->)(.*?)(<!--/-->)", re.DOTALL)
JOINTS = (
    ("rig", "shoulder"),
    *(("excavator", joint) for joint in ("boom", "arm", "bucket", "swing")),
)
TIMES = (*map(column_of, JUDGED), WHOLE)
"""columns of the table of verdicts that the README's table has as rows"""

MACHINES = {
    "boom": "boom (virtual)",
    "crane": "truck's crane with a telescope (virtual)",
    "forwarder": "forwarder's crane (virtual)",
}
"""of `docs/machines.py`, and what the gallery calls them"""

Figures = dict[str, Any]


def collected(runs: Path, former: Figures) -> Figures:
    """Return the figures of the runs of both targets of `make`, and those of further
    machines; of machines without a run the former ones."""
    stage_1, stage_2 = (load_record(runs / "demo" / stage) for stage in ("mech", "hyd"))
    rig = _joints(stage_2)
    for one in stage_1.verdict:
        rig[one.name]["stage_1_deg"] = _rounded(one.fitted_deg)
    quantities = {
        "stage 1": _quantities(stage_1.summary),
        "stage 2": _quantities(stage_2.summary),
    }
    parameters = {
        name: {
            "value": _rounded(one.value),
            "from": _rounded(one.interval[0]),
            "to": _rounded(one.interval[1]),
        }
        for name, one in stage_2.summary.estimate.items()
    }
    excavator = _joints(load_record(runs / "excavator" / "fit"))
    return {
        "rig": rig,
        "excavator": excavator,
        "machines": _machines(runs, former.get("machines", {})),
        # of `make bench B=others`
        "others": former.get("others", {}),
        "quantities": quantities,
        "parameters": parameters,
    }


def _machines(runs: Path, former: Figures) -> Figures:
    """Return what the verdict says of the joints of the gallery's further machines, by
    name."""
    machines = Figures()
    for name in MACHINES:
        folder = runs / name / "fit"
        if not (folder / "report.html").exists():
            machines[name] = former.get(name, {})
            continue
        joints = _joints(load_record(folder))
        shown = ("verdict", "beside")
        machines[name] = {
            joint: {key: figures[key] for key in shown}
            for joint, figures in joints.items()
        }
    return machines


def _joints(record: FinishedRun) -> Figures:
    """Return what the verdict says of each joint, and the mean absolute errors
    [deg]."""
    joints, fitted, unseen = (
        Figures(),
        record.result.fitted,
        [*record.validations.values()],
    )
    shown = verdict_table({"": record.verdict})
    for one, cells in zip(record.verdict, shown.rows, strict=True):
        row = dict(zip(shown.header, cells, strict=True))
        joints[one.name] = {
            "verdict": row["verdict"],
            "beside": {name: row[name] for name in TIMES},
            "fitted_deg": _rounded(one.fitted_deg),
            "unseen_deg": _rounded(one.unseen_deg),
            "fitted_mae_deg": _mean_absolute(fitted, one.joint),
            "unseen_mae_deg": _mean_absolute(unseen, one.joint),
            "inside_percent": _rounded(one.inside_percent),
            **{name: _rounded(error) for name, error in one.baselines_deg.items()},
            "ahead": {
                name: [*map(_rounded, errors)]
                for name, errors in one.horizons_deg.items()
            },
            "compared": {
                name: [comparison.outcome.value for comparison in comparisons]
                for name, comparisons in one.compared.items()
            },
        }
    return joints


def _mean_absolute(predictions: Sequence[Prediction], joint: int) -> float | None:
    errors: list[Array] = [one.error(joint) for one in predictions]
    return (
        _rounded(float(np.degrees(np.abs(np.concatenate(errors)).mean())))
        if errors
        else None
    )


def _quantities(summary: FitSummary) -> list[Figures]:
    return [
        {
            "label": one.said,
            "unit": one.unit,
            "value": _rounded(one.value),
            "interval": [*map(_rounded, ends)],
        }
        for one in summary.quantities.values()
        if (ends := one.interval)
    ]


def _rounded(value: float | None) -> float | None:
    """Return six digits: more than any page states, or a page would round what is
    rounded."""
    return None if value is None else float(f"{value:.6g}")


def at_a_glance(figures: Figures) -> str:
    """Return the README's table."""
    lines = [
        ["", *(f"{machine}: {joint}" for machine, joint in JOINTS)],
        ["---"] * 6,
    ]
    joints = [figures[machine][joint] for machine, joint in JOINTS]
    lines.append(["verdict", *(one["verdict"] for one in joints)])
    for name in TIMES:
        of = name if name == WHOLE else f"after {name}"
        lines.append([of, *(one["beside"][name] for one in joints)])
    lines.append(["whole fitted logs", *(_error(one["fitted_deg"]) for one in joints)])
    return _table(lines)


def ahead(figures: Figures) -> str:
    """Return the table of errors by prediction time."""
    head = ["after [s]", "", *(f"{seconds:g}" for seconds in HORIZONS), WHOLE]
    lines = [head, ["---"] * len(head)]
    for machine, joint in JOINTS:
        one = figures[machine][joint]
        by_model = one["ahead"]
        own = [*by_model[THE_FIT], one["unseen_deg"]]
        lines.append([f"{machine}, {joint}", "hydroid", *map(_error, own)])
        simple = ([*by_model[name], one[name]] for name in NAMES[1:])
        pairs = ["; ".join(map(_error, pair)) for pair in zip(*simple, strict=True)]
        lines.append(["", "table of speeds; nine numbers", *pairs])
    return _table(lines)


def not_better(figures: Figures) -> str:
    """Return the sentence on where a simple model is better, or may be."""
    times = [f"{seconds:g}" for seconds in JUDGED]
    exceptions = list[str]()
    for machine, joint in JOINTS:
        compared = figures[machine][joint]["compared"]
        at = {outcome: list[str]() for outcome in Outcome}
        for seconds in JUDGED:
            outcomes = {compared[name][HORIZONS.index(seconds)] for name in NAMES[1:]}
            # of several the one that says least for the fit
            least = next(
                one
                for one in (Outcome.WORSE, Outcome.UNTOLD, Outcome.BETTER)
                if one in outcomes
            )
            at[least].append(f"{seconds:g}")
        exceptions += [
            f"the {joint} after {listed(at[outcome])} s ({outcome})"
            for outcome in (Outcome.UNTOLD, Outcome.WORSE)
            if at[outcome]
        ]
    but = f", but for {listed(exceptions)}" if exceptions else ""
    return f"After {listed(times)} s every joint is predicted better than by both simple models{but}."


def quantities(figures: Figures) -> str:
    """Return the table of what the demo's fits state about the rig."""
    lines = [["stage", "quantity", "value", "95 % interval"], ["---"] * 4]
    for stage, rows in figures["quantities"].items():
        for row in rows:
            low, high = (
                "no limit" if end is None else number(end) for end in row["interval"]
            )
            unit = f" [{row['unit']}]" if row["unit"] else ""
            lines.append(
                [
                    stage,
                    f"{row['label']}{unit}",
                    number(row["value"]),
                    f"{low} to {high}",
                ]
            )
    return _table(lines)


def machines(figures: Figures) -> str:
    """Return the gallery's table of machines and their verdicts."""
    head = ["machine", "joint", "verdict", *(f"after {time}" for time in TIMES[:-1])]
    lines = [[*head, WHOLE], ["---"] * (len(head) + 1)]
    groups = {
        "rig of one arm (virtual)": figures["rig"],
        **{called: figures["machines"][name] for name, called in MACHINES.items()},
        "excavator (real)": figures["excavator"],
    }
    for machine, joints in groups.items():
        for joint, one in joints.items():
            # logs of 5 s say nothing of 5 and 10 s
            errors = [one["beside"][time] or "–" for time in TIMES]
            lines.append([machine, joint, one["verdict"], *errors])
            machine = ""
    return _table(lines)


def others(figures: Figures) -> str:
    """Return the table of least squares of other programs, of the problems that were
    measured."""
    head = ["parameters", "program", "reached the optimum", "simulations", "CPU time"]
    lines = [head, ["---"] * len(head)]
    for count, rows in figures["others"].items():
        for name, row in rows.items():
            lines.append([str(count), name, *row])
    return _table(lines)


PARTS: dict[str, Callable[[Figures], str]] = {
    "at a glance": at_a_glance,
    "ahead": ahead,
    "not better": not_better,
    "quantities": quantities,
    "machines": machines,
    "others": others,
}


def filled(text: str, figures: Figures) -> str:
    """Return a page with its marked parts as the figures have them."""

    def part(found: re.Match[str]) -> str:
        begin, name, _, end = found.groups()
        if name in PARTS:
            words = PARTS[name](figures)
        else:
            value: Any = figures
            for key in name.split("."):
                value = value[key]
            words = _stated(name, value)
        return f"{begin}{words}{end}"

    return MARKED.sub(part, text)


def _stated(name: str, value: float | None) -> str:
    """Return one number as a sentence or a table by hand states it."""
    if value is None or not name.endswith(("percent", "mae_deg")):
        return _error(value)
    return f"{value:.0f}" if name.endswith("percent") else f"{value:.2f}"


def _error(value: float | None) -> str:
    if value is None:
        return "diverged"
    return f"{value:.0f}" if value >= 100 else f"{value:#.2g}".rstrip(".")


def _table(lines: Sequence[Sequence[str]]) -> str:
    rows = "\n".join(
        f"| {' | '.join(cells)} |".replace("|  |", "| |") for cells in lines
    )
    return f"\n\n{rows}\n\n"


def marked() -> Iterator[tuple[Path, str]]:
    """Yield the pages that have marked parts, with their text."""
    for page in PAGES:
        if MARKED.search(text := page.read_text(encoding="utf-8")):
            yield page, text


def main(given: Sequence[str]) -> None:
    """Write the file, unless only the pages are asked for, and the pages."""
    if given != ["--pages"]:
        try:
            former = yaml.safe_load(FILE.read_text(encoding="utf-8"))
            found = collected(Path(*given) if given else ROOT / "runs", former)
        except HydroidError as error:
            sys.exit(f"{error}; `make demo excavator` comes first")
        write_atomic(
            FILE,
            HEAD
            + yaml.safe_dump(found, sort_keys=False, allow_unicode=True, width=110),
        )
    figures = yaml.safe_load(FILE.read_text(encoding="utf-8"))
    for page, text in marked():
        write_atomic(page, filled(text, figures))


if __name__ == "__main__":
    main(sys.argv[1:])
