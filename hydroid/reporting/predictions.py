"""Predictions against time: what logs commanded and measured at each joint, and what models simulate."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import cycle
from typing import Any

import numpy as np

from hydroid.fitting.validation import Prediction
from hydroid.fitting.verdict import rms_deg
from hydroid.reporting.chart import SERIES, ZERO, Chart, Mark, Panel, finite
from hydroid.reporting.moving_arm import motion_section
from hydroid.reporting.page import Plot, Section, Tab, log_names, short_name
from hydroid.reporting.table import Cell, Table
from hydroid.reporting.verdict_table import Verdicts
from hydroid.settings.arm import Arm
from hydroid.words import number

_KINDS = {True: "unseen", False: "fitted", None: ""}
_MOST = 1000
"""parts of one response of which the lowest and the highest sample are drawn"""


@dataclass(frozen=True, eq=False)
class JointResponse:
    """One joint in one log: their names, the joint's number from 1, and all predictions of the log."""

    log: str
    name: str
    joint: int
    of: tuple[Prediction, ...]


def joint_responses(predictions: Sequence[Prediction], arm: Arm) -> list[JointResponse]:
    """Return all joints in all logs, each with all models; fits that read a log differently stay apart."""
    names, groups = _names(predictions), dict[tuple[str, int, bytes], list[Prediction]]()
    for one in predictions:
        for joint in one.joints:
            read = one.log.angle[:, joint - 1].tobytes() + one.log.command[:, joint - 1].tobytes()
            groups.setdefault((names[one.log.source], joint, read), []).append(one)
    return [
        JointResponse(log, arm.joint_names[joint - 1], joint, tuple(several))
        for (log, joint, _), several in groups.items()
    ]


def prediction_sections(predictions: Sequence[Prediction], arm: Arm, fits: Verdicts) -> tuple[Section, ...]:
    """Return the arm in motion, and each joint's error in each log with the responses behind it.

    The first prediction of a log is the one that moves, and whose errors are shown; they are coloured by the
    tolerances of the first of the fits.
    """
    names, first = _names(predictions), dict[str, Prediction]()
    for one in predictions:
        first.setdefault(names[one.log.source], one)
    responses = joint_responses(predictions, arm)
    bins = min(_MOST, max(150, 9000 // max(len(responses), 1)))  # a page of many responses stays small
    tolerances = {one.joint: one.tolerance_deg for one in next(iter(fits.values()), ())}
    tabs: list[Tab] = []
    for i, one in enumerate(responses):
        plot = Plot(f"response_{i + 1}", f"{one.name} in {one.log}", partial(draw, one, bins), zoom=True)
        error, tolerance = rms_deg([one.of[0].error(one.joint)]), tolerances.get(one.joint, np.inf)
        state = "good" if error <= tolerance else "fair" if error <= 2 * tolerance else "bad"
        row = f"{one.log} {_KINDS[one.of[0].unseen]}".strip()
        tabs.append(Tab(f"{error:.2g}°", (plot,), row, one.name, state))
    text = "Rms error of each joint in each log; choose one to see the response with its 95 % band."
    errors = {"errors": error_table(predictions, arm)}
    return (*motion_section(arm, first), Section("Errors by log", text, tabs=tuple(tabs), more=errors))


def error_table(predictions: Sequence[Prediction], arm: Arm) -> Table:
    """Return the error of each fit on each log and joint, with what the fitted logs lead to expect."""
    names = _names(predictions)
    columns = {
        "mean absolute [deg]": "mae_deg",
        "rms [deg]": "rms_deg",
        "largest [deg]": "max_deg",
        "fit [%]": "fit_percent",
        "expected [deg]": "expected_deg",
        "inside band [%]": "inside_percent",
    }

    def row(one: Prediction, known: Mapping[str, Any]) -> dict[str, Cell]:
        of = {"fit": short_name(one.fit), "log": names[one.log.source], "": _KINDS[one.unseen]}
        return {**of, "joint": known["name"], **{name: known.get(key) for name, key in columns.items()}}

    note = (
        "fit: 0 % for the mean of the measured angle. expected: the rms error that the fit leads to expect."
    )
    optional = "mean absolute [deg]", "largest [deg]", "inside band [%]", "expected [deg]"
    rows = (row(one, known) for one in predictions for known in one.plain(arm.joint_names))
    return Table.of("Errors", rows, note, optional)


def draw(response: JointResponse, bins: int = _MOST) -> Chart:
    """Draw the measured angle of one joint, every model's response and residual, command and pressures."""
    log, joint = response.of[0].log, response.joint - 1
    measured = np.degrees(log.angle[:, joint])
    upper = [Mark("line", log.time, measured, color="ink", label="measured", width=5, alpha=0.35)]
    middle = [ZERO]
    # a response that runs away, by three ranges of the measured angle, must not flatten the others
    far = 3.0 * max(float(np.ptp(measured)), 1.0)
    for i, (one, color) in enumerate(zip(response.of, cycle(SERIES), strict=False)):
        residual, name = np.degrees(finite(one.error(response.joint))), short_name(one.fit)
        rms = float(np.sqrt(np.mean(residual**2)))
        label = f"{name} ({number(rms)}° rms)" if np.isfinite(rms) else f"{name} (diverged)"
        residual[np.abs(residual) > far] = np.nan
        upper.append(Mark("line", log.time, measured - residual, color=color, label=label, off=i > 0))
        middle.append(Mark("line", log.time, residual, color=color, label=label, width=1, off=i > 0))
        if band := one.bands.get(response.joint):
            half = np.degrees(band.half)
            useless = ", wider than the motion" if np.mean(2 * half) > np.ptp(measured) else ""
            # nor must a band that the parameters leave open
            half = np.fmin(half, 2.0 * float(np.nanmax(np.abs(residual), initial=1e-6)))
            label = f"95 % band of {name}{useless}"
            middle.insert(
                0, Mark("band", log.time, -half, half, color=color, label=label, alpha=0.18, off=i > 0)
            )
    panels = [
        Panel("", "angle [deg]", tuple(upper), f"{response.name} in {response.log}", 280),
        Panel("", "residual [deg]", tuple(middle), height=190),
    ]
    pressure = None if log.pressure is None else log.pressure[:, joint]
    if pressure is not None and np.isfinite(pressure).any():
        marks = tuple(
            Mark("line", log.time, 1e-5 * p, color=color, label=f"chamber {side}")
            for side, color, p in zip("AB", ("green", "pink"), pressure.T, strict=True)
        )
        panels.append(Panel("", "pressure [bar]", marks, height=150))
    command = Mark("step", log.time, log.command[:, joint], color="grey")
    panels.append(Panel("time [s]", "command [%]", (command,), height=140, y_limits=(-108, 108)))
    return Chart(tuple(panels), linked=True, bins=bins)


def _names(predictions: Sequence[Prediction]) -> dict[str, str]:
    """A short name of each log by its source, all different."""
    logs = {p.log.source: p.log for p in predictions}
    return dict(zip(logs, log_names(list(logs.values())), strict=True))
