"""Responses against time: what one log commanded and measured at one joint, and what models simulate."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from hydroid.fitting.fit import Fit
from hydroid.log import Log
from hydroid.parameters import Array
from hydroid.problem.problem import Problem
from hydroid.report.chart import SERIES, Chart, Mark, Panel, finite
from hydroid.report.page import Plot, Tab, log_names
from hydroid.report.phrases import estimate_label
from hydroid.report.table import numbers_csv
from hydroid.words import number

_CAPTION = (
    "Measured and simulated angle; measured minus simulated angle with the 95 % prediction band; command. "
    "Drag to zoom into a stretch of time. The full series are in responses/ as CSV."
)
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
        time: [s], shape (T,).
        command: of this joint [%], shape (T,).
        measured: angle [rad], shape (T,).
        simulated: angle [rad] by the model's name, shape (T,); the first is the one to use.
        bands: half the prediction band [rad] by the model's name, shape (T,).
        off: models that are not shown until a reader asks for them.
        pressures: measured pressures of both chambers [Pa], shape (T, 2); None: not logged.
    """

    log: str
    joint: int
    time: Array
    command: Array
    measured: Array
    simulated: Mapping[str, Array] = field(default_factory=dict[str, Array])
    bands: Mapping[str, Array] = field(default_factory=dict[str, Array])
    off: frozenset[str] = frozenset()
    pressures: Array | None = None

    def mean_squares(self) -> list[float]:
        """Return each model's mean squared error [rad²], infinite where it diverged."""
        errors = (np.mean((self.measured - angle) ** 2) for angle in self.simulated.values())
        return [float(np.nan_to_num(error, nan=np.inf)) for error in errors]

    def csv(self) -> str:
        """Return the whole record and all responses, in deg and %."""
        angles = {"measured_deg": self.measured} | {f"{n}_deg": a for n, a in self.simulated.items()}
        columns = [self.time, self.command, *(np.degrees(a) for a in angles.values())]
        header = ["time_s", "command_pct", *angles]
        for name, half in self.bands.items():
            header.append(f"{name} half_band_deg")
            columns.append(np.degrees(half))
        return numbers_csv(header, np.column_stack(columns))


def joint_responses(problem: Problem, fit: Fit) -> list[JointResponse]:
    """Return the records and all estimates' responses of a fit, log by log; the final estimate first."""
    responses: list[JointResponse] = []
    names = [fit.final, *(name for name in fit.estimates if name != fit.final)]
    off = frozenset(estimate_label(fit, name) for name in names[1:])
    halves = iter(_fitted_bands(problem, fit))
    for i, (log, name) in enumerate(zip(problem.logs, log_names(problem.logs), strict=True)):
        for k, joint in enumerate(problem.outputs):
            simulated = {estimate_label(fit, n): fit.estimates[n].responses[i][:, k] for n in names}
            record = log.time, log.command[:, joint], log.angle[:, joint]
            bands = {estimate_label(fit, fit.final): next(halves)}
            pressures = logged_pressures(log, joint)
            responses.append(JointResponse(name, joint + 1, *record, simulated, bands, off, pressures))
    return responses


def logged_pressures(log: Log, joint: int) -> Array | None:
    """Return both chambers' measured pressures of a joint, from 0 [Pa], shape (T, 2); None: not logged."""
    known = log.pressure[:, joint] if log.pressure is not None else None
    return known if known is not None and np.isfinite(known).any() else None


def _fitted_bands(problem: Problem, fit: Fit) -> list[Array]:
    """Return half the 95 % prediction band of each compared angle [rad], shape (T,), log by log."""
    known = fit.quantities.precision
    slopes = fit.uncertainty.jacobian.slopes[fit.uncertainty.free]
    found: list[Array] = []
    for channel, noise in zip(problem.channels, fit.uncertainty.noise, strict=True):
        if channel.quantity == "angle":
            angle = known.deviation(np.nan_to_num(slopes[:, channel.rows])) / channel.weight
            found.append(known.quantile * np.hypot(angle, noise.level / channel.weight))
    return found


def response_tabs(
    responses: Mapping[str, JointResponse], notes: Mapping[str, str] | None = None
) -> tuple[Tab, ...]:
    """Return one tab per log with the plots of its joints, by file name; `notes` are of logs by name."""
    bins = min(_MOST, max(_FEWEST, _POINTS // max(len(responses), 1)))
    logs: dict[str, list[Plot]] = {}
    for name, one in responses.items():
        logs.setdefault(one.log, []).append(
            Plot(name, f"Joint {one.joint} in {one.log}. {_CAPTION}", partial(draw, one, bins), True)
        )
    return tuple(Tab(log, tuple(plots), (notes or {}).get(log, "")) for log, plots in logs.items())


def response_data(responses: Mapping[str, JointResponse]) -> dict[str, str]:
    """Return all responses as CSV by file."""
    return {f"responses/{name}.csv": one.csv() for name, one in responses.items()}


def draw(response: JointResponse, bins: int = _MOST) -> Chart:
    """Draw the measured angle of one joint, every model's response and residual, command and pressures."""
    time, measured = response.time, np.degrees(response.measured)
    upper = [Mark("line", time, measured, color="ink", label="measured", width=5, alpha=0.35)]
    middle = [Mark("rule", y=np.zeros(1), color="grey", width=1)]
    reach = _RUNAWAY * max(float(np.ptp(measured)), _LEAST_RANGE)
    low, high = float(measured.min()) - reach, float(measured.max()) + reach
    for color, (name, angle) in zip(
        SERIES * (1 + len(response.simulated)), response.simulated.items(), strict=False
    ):
        simulated = np.degrees(finite(angle))
        residual = measured - simulated
        rms = float(np.sqrt(np.mean(residual**2)))
        off = name in response.off
        label = f"{name} ({number(rms)} deg rms)" if np.isfinite(rms) else f"{name} (diverged)"
        # a response that runs away must not flatten the others
        near = np.where((simulated > low) & (simulated < high), simulated, np.nan)
        error = np.where(np.abs(residual) < reach, residual, np.nan)
        upper.append(Mark("line", time, near, color=color, label=label, off=off))
        middle.append(Mark("line", time, error, color=color, label=label, off=off, width=1))
        if name in response.bands:
            # a band that the parameters leave open must not flatten the residual either
            widest = _WIDEST * float(np.nanmax(np.abs(residual), initial=_LEAST_RESIDUAL))
            half = np.fmin(np.degrees(response.bands[name]), widest)
            label = f"95 % band of {name}"
            middle.insert(0, Mark("band", time, -half, half, color=color, label=label, alpha=0.18, off=off))
    panels = [
        Panel("", "angle [deg]", tuple(upper), f"Joint {response.joint} in {response.log}", 280),
        Panel("", "residual [deg]", tuple(middle), height=190),
    ]
    if response.pressures is not None:
        chambers = zip(
            ("chamber A", "chamber B"), ("green", "pink"), 1e-5 * response.pressures.T, strict=True
        )
        marks = tuple(Mark("line", time, p, color=color, label=name) for name, color, p in chambers)
        panels.append(Panel("", "pressure [bar]", marks, height=150))
    command = Mark("step", time, response.command, color="grey")
    panels.append(Panel("time [s]", "command [%]", (command,), height=140, y_limits=(-108, 108)))
    return Chart(tuple(panels), linked=True, bins=bins)
