"""Several finished reports side by side: their verdicts, errors, parameters and responses on one page."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from hydroid.report.page import Bar
from hydroid.report.page_file import SCHEMA
from hydroid.words import number, plain

_SERIES = ("orange", "blue", "green", "pink", "yellow", "sky")

Content = Mapping[str, Any]


def comparison(contents: Mapping[str, Content]) -> dict[str, Any]:
    """Return the content of a page that compares others, by name; see `page_file.page_content`."""
    tables = [t for t in (_errors(contents),) if t["rows"]]
    charts, tabs = _responses(contents)
    sections: list[dict[str, Any]] = [
        _section("Verdicts", tables=[_verdicts(contents)], text="Each report in one line."),
    ]
    if tabs:
        text = "The responses of all reports to the same logs. Those that are off can be switched on."
        sections.append(_section("Prediction", text=text, tabs=tabs, tables=tables))
    sections += _parameters(contents)
    sections += [
        _section(f"Before you use {name}", points=list(content["warnings"]))
        for name, content in contents.items()
        if content["warnings"]
    ]
    best = _best(contents)
    return {
        "schema": SCHEMA,
        "name": "comparison",
        "title": f"{len(contents)} reports side by side",
        "lead": best,
        "verdict": {"prediction": best, "parameters": "", "lights": []},
        "warnings": [],
        "sections": sections,
        "charts": charts,
        "moving": [],
        "versions": next(iter(contents.values()))["versions"],
        "numbers": {"kind": "comparison"},
    }


def names_of(files: Sequence[Path]) -> list[str]:
    """Return short names of reports, all different: of their folders, or with those above them."""
    parts = [file.resolve().parent.parts for file in files]
    depth = 1
    while len({part[-depth:] for part in parts}) < len(parts) and depth < max(map(len, parts)):
        depth += 1
    return ["/".join(part[-depth:]) for part in parts]


def _section(title: str, **filled: Any) -> dict[str, Any]:
    empty: dict[str, Any] = {
        key: [] for key in ("points", "facts", "tables", "more", "plots", "tabs", "bars", "steps")
    }
    return {"title": title, "text": "", "folded": False} | empty | filled


def _table(
    title: str, header: Sequence[str], rows: Sequence[Sequence[str]], note: str = ""
) -> dict[str, Any]:
    return {
        "title": title,
        "header": list(header),
        "rows": rows,
        "numeric": [False] * len(header),
        "note": note,
    }


def _verdicts(contents: Mapping[str, Content]) -> dict[str, Any]:
    """One row per report: its sentences, and the answer to each question that any of them asks."""
    strips = {name: content["verdict"] or {} for name, content in contents.items()}
    questions = list(
        dict.fromkeys(light["question"] for s in strips.values() for light in s.get("lights", ()))
    )
    rows: list[list[str]] = []
    for name, strip in strips.items():
        answers = {light["question"]: light["answer"] for light in strip.get("lights", ())}
        sentence = strip.get("prediction", contents[name]["lead"])
        rows.append([name, sentence, strip.get("parameters", ""), *(answers.get(q, "–") for q in questions)])
    return _table("", ("report", "prediction", "parameters", *questions), rows)


def _errors(contents: Mapping[str, Content]) -> dict[str, Any]:
    """All errors on logs: of fits on their own, of validations on theirs."""
    rows: list[list[str]] = []
    found: dict[tuple[str, ...], str] = {}  # in which report each stands first: a fit's own may show it too
    for name, content in contents.items():
        numbers = content["numbers"]
        if numbers.get("kind") == "fit" and numbers["rms_deg"] is not None:
            rows.append([name, "its own logs", "fitted", number(numbers["rms_deg"])])
        for error in numbers.get("errors", ()):
            seen = "unseen" if error["unseen"] else "fitted"
            rms = "–" if error["rms_deg"] is None else number(error["rms_deg"])
            found.setdefault((error["fit"], error["log"], seen, rms), name)
    rows += [[fit if fit == name else f"{fit} (in {name})", *rest] for (fit, *rest), name in found.items()]
    return _table("Errors", ("report", "log", "log is", "rms [deg]"), rows)


def _best(contents: Mapping[str, Content]) -> str:
    """Name the best fit on unseen logs, or on its own where no log is unseen."""
    unseen = [
        (error["rms_deg"], error["fit"])
        for content in contents.values()
        for error in content["numbers"].get("errors", ())
        if error["unseen"] and error["rms_deg"] is not None
    ]
    if unseen:
        value, name = min(unseen)
        return f"{name} predicts an unseen log best, with an error of {value:.2g}° rms."
    own = [(c["numbers"].get("rms_deg"), name) for name, c in contents.items()]
    known = [(value, name) for value, name in own if value is not None]
    if known:
        value, name = min(known)
        return (
            f"{name} reproduces its own logs best, with an error of {value:.2g}° rms. No log here is unseen."
        )
    return "; ".join(f"{name}: {content['title']}" for name, content in contents.items())


def _parameters(contents: Mapping[str, Content]) -> list[dict[str, Any]]:
    """One list of bars per report, over the same bounds: the widest of all."""
    fits = {n: c["numbers"]["parameters"] for n, c in contents.items() if c["numbers"].get("kind") == "fit"}
    if not fits:
        return []
    bars: list[dict[str, Any]] = []
    for parameter in dict.fromkeys(name for known in fits.values() for name in known):
        having = {name: known[parameter] for name, known in fits.items() if parameter in known}
        low = min(p["bounds"][0] for p in having.values())
        high = max(p["bounds"][1] for p in having.values())
        log = low > 0 and all(p["log"] for p in having.values())

        def place(value: float, low: float = low, high: float = high, log: bool = log) -> float:
            if log:
                value, low, high = (math.log(max(v, 1e-300)) for v in (value, low, high))
            return min(max((value - low) / (high - low), 0.0), 1.0)

        for i, (name, p) in enumerate(having.items()):
            ends = [end for end in p["interval"] if end is not None]
            known = len(ends) == 2
            bars.append(
                vars(
                    Bar(
                        parameter if i == 0 else "",
                        f"{p['meaning']}: {name}" if i == 0 else name,
                        f"{number(p['value'])} {p['unit']}".rstrip(),
                        f"{number(ends[0])} to {number(ends[1])}" if known else "no interval",
                        (plain(float(f"{low:.3g}")), plain(float(f"{high:.3g}"))),
                        state="known" if known else "unknown",
                        at=place(p["value"]),
                        band=(place(ends[0]), place(ends[1])) if known else None,
                    )
                )
            )
    text = "Each parameter with its 95 % interval, fit by fit, between the widest bounds of all."
    return [_section("Parameters", text=text, bars=bars)]


def _responses(contents: Mapping[str, Content]) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """Charts of responses, those to one record merged, and tabs by log."""
    charts: dict[str, dict[str, Any]] = {}
    tabs: dict[str, dict[str, Any]] = {}
    for name, content in contents.items():
        for tab in (t for s in content["sections"] if s["title"].startswith("Prediction") for t in s["tabs"]):
            for plot in tab["plots"]:
                chart = content["charts"][plot["chart"]]
                title = chart["panels"][0]["title"]
                if title in charts:
                    _merge(charts[title], chart, name)
                    continue
                charts[title] = _named(chart, name)
                own = tabs.setdefault(tab["name"], {"name": tab["name"], "note": tab["note"], "plots": []})
                own["plots"].append(plot | {"chart": len(charts) - 1})
    return list(charts.values()), list(tabs.values())


def _named(chart: Content, name: str) -> dict[str, Any]:
    """Return a chart whose models carry the report's name; all but its first panel's label stay."""
    panels = [p | {"marks": [_of(mark, name) for mark in p["marks"]]} for p in chart["panels"]]
    return dict(chart) | {"panels": panels}


def _of(mark: Content, name: str) -> dict[str, Any]:
    shared = not mark["label"] or mark["label"] in ("measured", "chamber A", "chamber B")
    return dict(mark) if shared else dict(mark) | {"label": f"{name}: {mark['label']}"}


def _merge(into: dict[str, Any], chart: Content, name: str) -> None:
    """Add the shown models of a chart to another of the same record, in colours that are free."""
    labels = dict.fromkeys(m["label"] for p in into["panels"] for m in p["marks"] if ": " in m["label"])
    free = len({label.partition(":")[0] for label in labels})
    for panel, more in zip(into["panels"], chart["panels"], strict=False):
        for mark in more["marks"]:
            added = _of(mark, name)
            if added["label"] != mark["label"] and not mark["off"]:
                panel["marks"].append(added | {"color": _SERIES[free % len(_SERIES)]})
