"""A fit's page with the logs that a validation predicted: the two pages' contents as one."""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from hydroid.report.fit_report import FITTED
from hydroid.report.moving_arm import MOTION
from hydroid.report.next_steps import PREDICT_UNSEEN
from hydroid.report.page import Light
from hydroid.report.validation_report import FROM_FIT, PREDICTION
from hydroid.report.verdict import VALIDATED
from hydroid.words import listed

Content = Mapping[str, Any]
NOTHING = "Nothing that these logs ask for. hydroid suggest also tests further sensors, logs and experiments."
_LISTS = {"chart": "charts", "moving": "moving"}
"""where a content keeps what a plot names by number"""


def with_validation(fit: Content, validation: Content) -> dict[str, Any]:
    """Return the content of a fit's page with the unseen logs of a validation of this fit alone.

    Logs that were validated before stay, unless they are validated again. A validation without an unseen log
    changes nothing.
    """
    errors = {e["log"]: e for e in validation["numbers"]["errors"] if e["unseen"]}
    if not errors:
        return dict(fit)
    known = {e["log"]: e for e in fit["numbers"].get("errors", ())} | errors
    shown = {title: _tabs(validation, title, errors) for title in (PREDICTION, MOTION)}
    sections: list[dict[str, Any]] = []
    for section in _embedded(fit):
        title = PREDICTION if section["title"] in (FITTED, PREDICTION) else section["title"]
        tabs = section["tabs"]
        if title in shown:
            unseen = {tab["name"]: tab for tab in tabs if tab["name"] in known}
            own = (tab for tab in tabs if tab["name"] not in known)
            tabs = [*(unseen | shown[title]).values(), *({**tab, "note": FROM_FIT} for tab in own)]
        steps = [step for step in section["steps"] if step["what"] != PREDICT_UNSEEN]
        nothing = {"text": NOTHING} if section["steps"] and not steps else {}
        sections.append(section | {"title": title, "tabs": tabs, "steps": steps} | nothing)
    own = fit.get("fitted_verdict", fit["verdict"])
    verdict = _verdict(own, list(known.values()))
    numbers = fit["numbers"] | {"errors": list(known.values())}
    changed = {"fitted_verdict": own, "verdict": verdict, "lead": verdict["prediction"], "numbers": numbers}
    return dict(fit) | changed | _indexed(sections)


def _tabs(content: Content, title: str, names: Iterable[str]) -> dict[str, Any]:
    """Return the tabs of some logs in the section of a title, by name."""
    sections = (section for section in _embedded(content) if section["title"] == title)
    return {tab["name"]: tab for section in sections for tab in section["tabs"] if tab["name"] in names}


def _verdict(own: Content, errors: Sequence[Content]) -> dict[str, Any]:
    """Return the fit's verdict with its error on unseen logs."""
    finite = [e["rms_deg"] for e in errors if e["rms_deg"] is not None]
    rms = f"{math.sqrt(sum(v**2 for v in finite) / max(len(finite), 1)):.2g}° rms"
    which = "an unseen log" if len(errors) == 1 else f"{len(errors)} unseen logs"
    answer = f"Yes: {rms} on {errors[0]['log'] if len(errors) == 1 else which}."
    worse = [e["log"] for e in errors if e["as_expected"] is False]
    if worse:
        answer += f" Clearly more than the fitted logs lead to expect on {listed(worse)}."
    light = vars(Light(VALIDATED, "fair" if worse else "good", answer))
    lights = [light if one["question"] == VALIDATED else one for one in own["lights"]]
    prediction = f"Predicts {which} with an error of {rms}. {own['prediction']}"
    return dict(own) | {"prediction": prediction, "lights": lights}


def _embedded(content: Content) -> list[dict[str, Any]]:
    """Return the sections, with what is drawn in the plots themselves."""
    return _changed(
        content["sections"], lambda p: {k: content[each][p[k]] for k, each in _LISTS.items() if k in p}
    )


def _indexed(sections: Sequence[Content]) -> dict[str, Any]:
    """Return sections and what they draw as a content has them: the reverse of `_embedded`."""
    lists: dict[str, list[Any]] = {name: [] for name in _LISTS.values()}

    def place(plot: Content) -> dict[str, int]:
        for kind in (k for k in _LISTS if k in plot):
            lists[_LISTS[kind]].append(plot[kind])
            return {kind: len(lists[_LISTS[kind]]) - 1}
        return {}

    return {"sections": _changed(sections, place)} | lists


def _changed(
    sections: Sequence[Content], change: Callable[[Content], Mapping[str, Any]]
) -> list[dict[str, Any]]:
    """Return sections in whose plots some values are others."""

    def plots(some: Sequence[Content]) -> list[dict[str, Any]]:
        return [{**plot, **change(plot)} for plot in some]

    return [
        {**s, "plots": plots(s["plots"]), "tabs": [{**t, "plots": plots(t["plots"])} for t in s["tabs"]]}
        for s in sections
    ]
