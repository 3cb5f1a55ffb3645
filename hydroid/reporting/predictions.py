"""Predictions against time: what logs commanded and measured at each joint, and what models simulate."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial
from math import degrees

import numpy as np

from hydroid.fitting.validation import Prediction
from hydroid.parameters import Array
from hydroid.reporting.chart import SERIES, ZERO, Chart, Mark, Panel, finite
from hydroid.reporting.moving_arm import motion_section
from hydroid.reporting.page import Plot, Section, Tab, log_names, short_name, unique
from hydroid.reporting.table import Cell, Table
from hydroid.reporting.verdict_table import Verdicts
from hydroid.settings.arm import Arm
from hydroid.words import number

_KINDS = {True: "unseen", False: "fitted", None: ""}
_MOST = 1000
"""parts of one response of which the lowest and the highest sample are drawn"""


@dataclass(frozen=True, eq=False)
class JointResponse:
    """The record of one joint, and what models simulate.

    Attributes:
        log: name of the log.
        joint: number of the joint, from 1.
        name: of the joint.
        of: a prediction of the log: time, command, measured angle and pressures are of its log.
        simulated: angle [rad] by the model's name, shape (T,); the first is the one to use.
        bands: half the prediction band [rad] by the model's name, shape (T,).
    """

    log: str
    joint: int
    name: str
    of: Prediction
    simulated: dict[str, Array] = field(default_factory=dict[str, Array])
    bands: dict[str, Array] = field(default_factory=dict[str, Array])

    @property
    def measured(self) -> Array:
        """Angle [rad], shape (T,)."""
        return self.of.log.angle[:, self.joint - 1]


def joint_responses(predictions: Sequence[Prediction], arm: Arm) -> list[JointResponse]:
    """Return the records of all joints, each with all models; fits that read a log differently stay apart."""
    names, records = _names(predictions), dict[object, JointResponse]()
    for one in predictions:
        log, name = one.log, names[one.log.source]
        for column, joint in enumerate(one.joints):
            key = name, joint, log.angle[:, joint - 1].tobytes(), log.command[:, joint - 1].tobytes()
            record = JointResponse(name, joint, arm.joint_names[joint - 1], one)
            record = records.setdefault(key, record)
            label = unique(short_name(one.fit), record.simulated)
            record.simulated[label] = one.response[:, column]
            if joint in one.bands:
                record.bands[label] = one.bands[joint].half
    return list(records.values())


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
        error = degrees(float(np.sqrt(np.mean((one.measured - next(iter(one.simulated.values()))) ** 2))))
        state = _state(error, tolerances.get(one.joint, np.inf))
        row = f"{one.log} {_KINDS[one.of.unseen]}".strip()
        tabs.append(Tab(f"{error:.2g}°", (plot,), row, one.name, state))
    text = "Rms error of each joint in each log; choose one to see the response with its 95 % band."
    errors = {"errors": error_table(predictions, arm)}
    return (*motion_section(arm, first), Section("Errors by log", text, tabs=tuple(tabs), more=errors))


def _state(error: float, tolerance: float) -> str:
    return "good" if error <= tolerance else "fair" if error <= 2 * tolerance else "bad"


def error_table(predictions: Sequence[Prediction], arm: Arm) -> Table:
    """Return the error of each fit on each log and joint, with what the fitted logs lead to expect."""
    names = _names(predictions)

    def row(one: Prediction, joint: int) -> dict[str, Cell]:
        errors, band = one.indices[joint], one.bands.get(joint)
        return {
            "fit": short_name(one.fit),
            "log": names[one.log.source],
            "": _KINDS[one.unseen],
            "joint": arm.joint_names[joint - 1],
            "mean absolute [deg]": degrees(errors.mean_absolute),
            "rms [deg]": degrees(errors.rms),
            "largest [deg]": degrees(errors.largest),
            "fit [%]": errors.fit,
            "expected [deg]": degrees(band.expected) if band else None,
            "inside band [%]": 100 * band.inside if band else None,
        }

    note = (
        "fit: 0 % for the mean of the measured angle. expected: the rms error that the fit leads to expect."
    )
    optional = "mean absolute [deg]", "largest [deg]", "inside band [%]", "expected [deg]"
    rows = (row(one, joint) for one in predictions for joint in one.joints)
    return Table.of("Errors", rows, note, optional)


def draw(response: JointResponse, bins: int = _MOST) -> Chart:
    """Draw the measured angle of one joint, every model's response and residual, command and pressures."""
    log, measured = response.of.log, np.degrees(response.measured)
    upper = [Mark("line", log.time, measured, color="ink", label="measured", width=5, alpha=0.35)]
    middle = [ZERO]
    # a response that runs away, by three ranges of the measured angle, must not flatten the others
    far = 3.0 * max(float(np.ptp(measured)), 1.0)
    for i, (name, angle) in enumerate(response.simulated.items()):
        residual = measured - np.degrees(finite(angle))
        rms = float(np.sqrt(np.mean(residual**2)))
        label = f"{name} ({number(rms)}° rms)" if np.isfinite(rms) else f"{name} (diverged)"
        residual[np.abs(residual) > far] = np.nan
        color, off = SERIES[i % len(SERIES)], i > 0
        upper.append(Mark("line", log.time, measured - residual, color=color, label=label, off=off))
        middle.append(Mark("line", log.time, residual, color=color, label=label, width=1, off=off))
        if name in response.bands:
            # nor must a band that the parameters leave open
            widest = 2.0 * float(np.nanmax(np.abs(residual), initial=1e-6))
            half = np.degrees(response.bands[name])
            useless = ", wider than the motion" if np.mean(2 * half) > np.ptp(measured) else ""
            band, half = f"95 % band of {name}{useless}", np.fmin(half, widest)
            middle.insert(
                0, Mark("band", log.time, -half, half, color=color, label=band, alpha=0.18, off=off)
            )
    panels = [
        Panel("", "angle [deg]", tuple(upper), f"{response.name} in {response.log}", 280),
        Panel("", "residual [deg]", tuple(middle), height=190),
    ]
    pressure = None if log.pressure is None else log.pressure[:, response.joint - 1]
    if pressure is not None and np.isfinite(pressure).any():
        marks = tuple(
            Mark("line", log.time, 1e-5 * p, color=color, label=f"chamber {side}")
            for side, color, p in zip("AB", ("green", "pink"), pressure.T, strict=True)
        )
        panels.append(Panel("", "pressure [bar]", marks, height=150))
    command = Mark("step", log.time, log.command[:, response.joint - 1], color="grey")
    panels.append(Panel("time [s]", "command [%]", (command,), height=140, y_limits=(-108, 108)))
    return Chart(tuple(panels), linked=True, bins=bins)


def _names(predictions: Sequence[Prediction]) -> dict[str, str]:
    """A short name of each log by its source, all different."""
    logs = {p.log.source: p.log for p in predictions}
    return dict(zip(logs, log_names(list(logs.values())), strict=True))
