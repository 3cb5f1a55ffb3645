"""How far pressures and flows went in the simulated logs, and whether the pump
suffices."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from hydroid.arrays import Array
from hydroid.estimate import FitSummary
from hydroid.fitting.validation import Prediction
from hydroid.prediction import OilTrace
from hydroid.reporting.page import Cell, Section, Table, log_names
from hydroid.reporting.response_report import BAR, LITRES_PER_MINUTE
from hydroid.reporting.shared_pump import SlowDown
from hydroid.reporting.stated_values import in_heading, value_and_origin, value_of
from hydroid.settings.arm import Arm
from hydroid.settings.fit import FitSettings
from hydroid.words import listed, three_digits, two_digits

_TEXT = (
    "The largest values in all logs of this page, as the model simulates them. Choose a joint "
    "in a log above to see them over time."
)
_NO_PUMP = (
    " The model's pump has no limit: the supply has {supply} at any flow, and no joint takes "
    "another's."
)
_PUMP = (
    " The pump gives all joints together at most {flow}, and its line has at most {supply}, where "
    "the relief valve opens."
)
_NO_RELIEF = " The model has no relief valves at the actuators."
_HEADER = (
    "joint",
    "pressure in A up to [bar]",
    "pressure in B up to [bar]",
    "flow in up to [L/min]",
    "flow: in log",
    "flow: at [s]",
)
_PUMP_HEADER = ("", "highest [bar]", "lowest [bar]", "lowest: in log", "lowest: at [s]")


@dataclass(frozen=True)
class _Peak:
    """The largest value of several traces: in which log, and when [s]."""

    value: float
    log: str
    time: float


def oil_section(
    settings: FitSettings,
    summary: FitSummary,
    predictions: Sequence[Prediction],
    slower: SlowDown | None,
) -> Section | None:
    """Return the section of the largest pressures and flows, and of how much slower
    joints are beside each other.

    None: the model has no hydraulics, or every simulation diverged.
    """
    usable = [p for p in predictions if p.oil and np.isfinite(p.response).all()]
    rows = _joint_rows(settings.arm, usable)
    if not rows:
        return None
    tables = {"oil": Table("", _HEADER, tuple(rows))}
    supply = value_and_origin(settings, summary, "supply_pressure")
    pump_words = _NO_PUMP
    most = ""
    flows = listed([f"{row[0]} {row[3]} L/min" for row in rows])
    answer = f"flow in up to: {flows}; no limit of the pump"
    if pump := _pump_row(usable):
        pump_words = _PUMP
        most = value_and_origin(settings, summary, "pump_flow")
        tables["pump"] = Table("", _PUMP_HEADER, (pump,))
        answer = f"pump at most {_pump_flow(settings, summary)}"
    if slower:
        tables["slower"] = slower.table
        answer += f"; {slower.answer}"
    measured = _measured_words(predictions)
    text = (
        f"{_TEXT} {measured.capitalize()}."
        + pump_words.format(supply=supply, flow=most)
        + _NO_RELIEF
    )
    answer += f"; {measured}"
    title = "Pressures, flows, shared pump"
    if slower is None:
        title = "Pressures and flows"
    return Section(title, text, tables=tables, folded=True, answer=answer)


def _pump_flow(settings: FitSettings, summary: FitSummary) -> str:
    """Write the largest flow of the pump for a heading."""
    value, estimate = value_of(settings, summary, "pump_flow")
    if estimate is None:
        return f"{two_digits(value or 0.0)} L/min (fixed)"
    return in_heading(summary, estimate, "L/min")


def _measured_words(predictions: Sequence[Prediction]) -> str:
    """Say whether the logs measure pressures."""
    logs = {one.log.source: one.log.pressure for one in predictions}
    measured = [p for p in logs.values() if p is not None and np.isfinite(p).any()]
    if not measured:
        return "no log measures pressures"
    return f"{len(measured)} of {len(logs)} logs measure pressures"


def _joint_rows(arm: Arm, predictions: Sequence[Prediction]) -> list[tuple[Cell, ...]]:
    """Return a row of each joint that a log drives, its name first."""
    joints = dict.fromkeys(joint for one in predictions for joint in one.joints)
    rows = list[tuple[Cell, ...]]()
    for joint in joints:
        of_joint = [one for one in predictions if joint in one.joints]
        row = _joint_row(joint, of_joint)
        if row:
            rows.append((arm.name_of(joint), *row))
    return rows


def _joint_row(joint: int, predictions: Sequence[Prediction]) -> tuple[Cell, ...]:
    """Return the largest pressures in both chambers of a joint and the largest flow into
    one; nothing of a joint that no log drives."""

    def pressure(side: int) -> Callable[[Prediction, OilTrace], Array]:
        return lambda one, oil: BAR * oil.pressure[:, one.joints.index(joint), side]

    def flow(one: Prediction, oil: OilTrace) -> Array:
        return LITRES_PER_MINUTE * oil.flow[:, one.joints.index(joint)].max(axis=1)

    in_a = _peak(predictions, pressure(0))
    in_b = _peak(predictions, pressure(1))
    inflow = _peak(predictions, flow)
    if in_a is None or in_b is None or inflow is None:
        return ()
    values = [three_digits(one.value) for one in (in_a, in_b, inflow)]
    return (*values, inflow.log, f"{inflow.time:.1f}")


def _pump_row(predictions: Sequence[Prediction]) -> tuple[Cell, ...]:
    """Return the highest and the lowest pressure of the pump's line; nothing without a
    pump."""

    def line(_: Prediction, oil: OilTrace) -> Array:
        return np.full(1, np.nan) if oil.line is None else BAR * oil.line

    high = _peak(predictions, line)
    low = _peak(predictions, lambda one, oil: -line(one, oil))
    if high is None or low is None:
        return ()
    ends = three_digits(high.value), three_digits(-low.value)
    return ("pump's line", *ends, low.log, f"{low.time:.1f}")


def _peak(
    predictions: Sequence[Prediction], trace: Callable[[Prediction, OilTrace], Array]
) -> _Peak | None:
    """Return the largest value of the traces of predictions; None where all are NaN."""
    names = log_names(prediction.log.source for prediction in predictions)
    largest: _Peak | None = None
    for prediction in predictions:
        if prediction.oil is None:
            continue
        values = trace(prediction, prediction.oil)
        if not np.isfinite(values).any():
            continue
        place = int(np.nanargmax(values))
        value = float(values[place])
        if largest is None or value > largest.value:
            time = float(prediction.log.time[place])
            largest = _Peak(value, names[prediction.log.source], time)
    return largest
