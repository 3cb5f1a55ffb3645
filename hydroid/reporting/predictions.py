"""Predictions against time: what logs commanded and measured at each joint, and what models simulate."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial
from math import degrees
from pathlib import Path

import numpy as np

from hydroid.files import file_name
from hydroid.fitting.validation import ErrorIndices, Prediction, pooled_indices
from hydroid.parameters import Array
from hydroid.reporting.chart import SERIES, Chart, Mark, Panel, finite
from hydroid.reporting.moving_arm import Movement, motion_section
from hydroid.reporting.page import Plot, Section, Tab, log_names, short_name, unique
from hydroid.reporting.table import Cell, Table, numbers_csv
from hydroid.settings.arm import Arm
from hydroid.words import number

INDICES = ("mean absolute [deg]", "rms [deg]", "largest [deg]", "fit [%]")
NOTES = {
    True: "Unseen: the fit was made without this log.",
    False: "Fitted: the fit was made from this log.",
    None: "",
}
_INDICES_NOTE = (
    "fit: 100 % for a perfect response, 0 % for the mean of the measured angle, a dash if it does not move."
)
_CAPTION = "Angle; measured minus simulated angle with the 95 % prediction band; command."
_POINTS = 9000
"""points of a page's responses: many responses are drawn with fewer points each"""
_FEWEST, _MOST = 150, 1000
"""parts of one response of which the lowest and the highest sample are drawn"""
_WIDEST = 2.0  # largest residuals: a wider band is cut, and fills the panel
_LEAST_RESIDUAL = 1e-6  # [deg]
_RUNAWAY = 3.0  # ranges of the measured angle: a response farther off has run away
_LEAST_RANGE = 1.0  # [deg] of the measured angle for _RUNAWAY: a joint may be at rest


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

    def csv(self) -> str:
        """Return the whole record and all responses, in deg and %."""
        log = self.of.log
        columns = {"time_s": log.time, "command_pct": log.command[:, self.joint - 1]}
        columns |= {"measured_deg": np.degrees(self.measured)}
        columns |= {f"{name}_deg": np.degrees(angle) for name, angle in self.simulated.items()}
        columns |= {f"{name} half_band_deg": np.degrees(half) for name, half in self.bands.items()}
        return numbers_csv(tuple(columns), np.column_stack(list(columns.values())))


def sources(predictions: Sequence[Prediction]) -> dict[str, str]:
    """Return a short name of each log by its source, all different."""
    logs = {p.log.source: p.log for p in predictions}
    return dict(zip(logs, log_names(list(logs.values())), strict=True))


def joint_responses(predictions: Sequence[Prediction], arm: Arm) -> list[JointResponse]:
    """Return the records of all joints, each with all models; fits that read a log differently stay apart.

    Of one fit all estimates are shown, of several fits the one to use of each.
    """
    names, several = sources(predictions), len({p.fit for p in predictions}) > 1
    records: dict[object, JointResponse] = {}
    for one in predictions:
        log = one.log
        for column, joint in enumerate(one.joints):
            k, name = joint - 1, names[log.source]
            key = name, joint, log.angle[:, k].tobytes(), log.command[:, k].tobytes()
            record = records.setdefault(key, JointResponse(name, joint, arm.joint_names[k], one))
            for estimate, angles in one.simulated.items():
                label = unique(short_name(one.fit), record.simulated) if several else estimate
                record.simulated[label] = angles[:, column]
                if angles is one.response and joint in one.bands:
                    record.bands[label] = one.bands[joint].half
                if several:
                    break
    return list(records.values())


def prediction_section(predictions: Sequence[Prediction], arm: Arm) -> Section:
    """Return the section with one tab per log, unseen logs first, and the table of errors."""
    ordered = sorted(predictions, key=lambda p: p.unseen is not True)
    notes = {name: NOTES[p.unseen] for p in ordered if (name := sources(ordered)[p.log.source])}
    responses = joint_responses(ordered, arm)
    bins = min(_MOST, max(_FEWEST, _POINTS // max(len(responses), 1)))
    logs: dict[str, list[Plot]] = {}
    for number_, one in enumerate(responses):
        plot = Plot(
            f"response_{number_ + 1}",
            f"{one.name} in {one.log}. {_CAPTION}",
            partial(draw, one, bins),
            True,
        )
        logs.setdefault(one.log, []).append(plot)
    tabs = tuple(Tab(log, tuple(plots), notes[log]) for log, plots in logs.items())
    return Section("Prediction", tabs=tabs, more={"errors": error_table(ordered, arm)})


def motion(predictions: Sequence[Prediction], arm: Arm) -> tuple[Section, ...]:
    """Return the section with the arm in motion in each log, as the first prediction of the log has it."""
    names, first = sources(predictions), dict[str, Prediction]()
    for one in sorted(predictions, key=lambda p: p.unseen is not True):
        first.setdefault(names[one.log.source], one)
    movements = [Movement.of(name, p.log, p.joints, p.response) for name, p in first.items()]
    return motion_section(arm, movements)


def error_table(predictions: Sequence[Prediction], arm: Arm) -> Table:
    """Return the error of each fit on each log and joint, with what the fitted logs lead to expect.

    Of one fit, errors over all of its own logs stand below, by estimate.
    """
    names = sources(predictions)
    rows: list[tuple[Cell, ...]] = []
    for one in predictions:
        seen = {True: "unseen", False: "fitted", None: ""}[one.unseen]
        for joint, indices in one.indices.items():
            band = one.bands.get(joint)
            expected = (degrees(band.expected), 100 * band.inside) if band else (None, None)
            place = (short_name(one.fit), names[one.log.source], seen, arm.joint_names[joint - 1])
            rows.append((*place, *index_cells(indices), *expected))
    fitted = [p for p in predictions if p.unseen is False]
    if len({p.fit for p in fitted}) == 1 and len(fitted[0].simulated) > 1:
        for estimate in fitted[0].simulated:
            pairs = [p.pair(joint, estimate) for p in fitted for joint in p.joints]
            rows.append((estimate, "all fitted", "", "all", *index_cells(pooled_indices(pairs)), None, None))
    header = ("fit", "log", "", "joint", *INDICES, "expected [deg]", "inside band [%]")
    note = f"{_INDICES_NOTE} expected: rms error that noise, parameters and left-out logs lead to expect."
    return Table(
        "Errors", header, tuple(rows), note, (INDICES[0], INDICES[2], "inside band [%]", "expected [deg]")
    )


def index_cells(indices: ErrorIndices) -> tuple[float, ...]:
    """Return the cells of INDICES."""
    return (degrees(indices.mean_absolute), degrees(indices.rms), degrees(indices.largest), indices.fit)


def response_data(predictions: Sequence[Prediction], arm: Arm) -> dict[str, str]:
    """Return all responses as CSV by file."""
    taken: set[str] = set()
    return {
        f"responses/{file_name(f'{Path(one.log).stem}_joint_{one.joint}', taken)}.csv": one.csv()
        for one in joint_responses(predictions, arm)
    }


def draw(response: JointResponse, bins: int = _MOST) -> Chart:
    """Draw the measured angle of one joint, every model's response and residual, command and pressures."""
    log, measured = response.of.log, np.degrees(response.measured)
    time = log.time
    upper = [_curve(time, measured, color="ink", label="measured", width=5, alpha=0.35)]
    middle = [Mark("rule", y=np.zeros(1), color="grey", width=1)]
    reach = _RUNAWAY * max(float(np.ptp(measured)), _LEAST_RANGE)
    low, high = float(measured.min()) - reach, float(measured.max()) + reach
    colors = SERIES * (1 + len(response.simulated))
    for color, (name, angle) in zip(colors, response.simulated.items(), strict=False):
        simulated = np.degrees(finite(angle))
        residual = measured - simulated
        rms = float(np.sqrt(np.mean(residual**2)))
        off = name != next(iter(response.simulated))
        label = f"{name} ({number(rms)}° rms)" if np.isfinite(rms) else f"{name} (diverged)"
        look = {"color": color, "label": label, "off": off}
        # a response that runs away must not flatten the others
        upper.append(_curve(time, _within(simulated, low, high), width=1.6, **look))
        middle.append(_curve(time, _within(residual, -reach, reach), width=1, **look))
        if name in response.bands:
            # a band that the parameters leave open must not flatten the residual either
            widest = _WIDEST * float(np.nanmax(np.abs(residual), initial=_LEAST_RESIDUAL))
            half = np.degrees(np.fmin(response.bands[name], np.radians(widest)))
            band = {"color": color, "label": f"95 % band of {name}", "alpha": 0.18, "off": off}
            middle.insert(0, Mark("band", time, -half, half, **band))  # pyright: ignore[reportArgumentType]
    panels = [
        Panel("", "angle [deg]", tuple(upper), f"{response.name} in {response.log}", 280),
        Panel("", "residual [deg]", tuple(middle), height=190),
    ]
    pressure = None if log.pressure is None else log.pressure[:, response.joint - 1]
    if pressure is not None and np.isfinite(pressure).any():
        chambers = zip(("chamber A", "chamber B"), ("green", "pink"), 1e-5 * pressure.T, strict=True)
        marks = tuple(_curve(time, p, color=color, label=name) for name, color, p in chambers)
        panels.append(Panel("", "pressure [bar]", marks, height=150))
    command = Mark("step", time, log.command[:, response.joint - 1], color="grey")
    panels.append(Panel("time [s]", "command [%]", (command,), height=140, y_limits=(-108, 108)))
    return Chart(tuple(panels), linked=True, bins=bins)


def _within(values: Array, low: float, high: float) -> Array:
    return np.where((values > low) & (values < high), values, np.nan)


def _curve(time: Array, values: Array, **look: object) -> Mark:
    return Mark("line", time, values, **look)  # pyright: ignore[reportArgumentType]
