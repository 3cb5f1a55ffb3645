"""Reports of studies of a model at an estimate: sensitivity, error surfaces, the next experiment."""

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path

import numpy as np

from hydroid.experiment.design import Design
from hydroid.parameters import Array
from hydroid.problem.problem import Problem
from hydroid.report.names import file_name, log_names
from hydroid.report.page import Page, Plot, Section
from hydroid.report.phrases import in_reader_units, norm_label
from hydroid.report.plots.contours import contours
from hydroid.report.plots.predictions import motion, precision
from hydroid.report.plots.sensitivities import ChannelCurves, response_families, slopes
from hydroid.report.table import Cell, Table, number
from hydroid.settings.arm import Arm
from hydroid.settings.experiment import DesignSettings
from hydroid.settings.problem import ObjectiveSettings
from hydroid.uncertainty.flags import Flag, flag_of
from hydroid.uncertainty.surface import Surface
from hydroid.uncertainty.sweep import Sweep

_QUANTITIES = {
    "angle": ("Angle", "q", "deg", 180 / np.pi),
    "pressure_a": ("Pressure A", "pA", "bar", 1e-5),
    "pressure_b": ("Pressure B", "pB", "bar", 1e-5),
}
_SHOWN = 0.15
"""parts of the weakest direction below this share of the largest are not named"""
SAFETY = (
    "The limits were checked only in simulation, at the present estimate. The machine moves differently as "
    "far as it differs from the model. Collisions were not checked. Watch the first run with a hand on the "
    "emergency stop."
)


def sensitivity_page(problem: Problem, theta: Array, sweep: Sweep) -> Page:
    """Return the page of a sensitivity study: the table `sensitivity` and one CSV per channel."""
    logs = log_names([log.source for log in problem.logs])
    free = [problem.parameters.parameters[i] for i in sweep.free]
    residual = problem.residuals(theta[None])[0]
    rows: list[tuple[Cell, ...]] = []
    plots: list[Plot] = []
    data: dict[str, str] = {}
    taken: set[str] = set()
    for channel, slope, response in zip(problem.channels, sweep.slopes, sweep.responses, strict=True):
        what, symbol, unit, factor = _QUANTITIES[channel.quantity]
        short, time = f"{symbol}{channel.joint}", problem.logs[channel.log].time
        output = factor * (channel.measured - residual[channel.rows] / channel.weight)
        name = file_name(f"sensitivity_{Path(logs[channel.log]).stem}_{short}", taken)
        title = f"{what} of joint {channel.joint} in {logs[channel.log]}"
        units = [(p.name, p.unit) for p in free]
        curves = ChannelCurves(title, unit, time, output, units)
        change = partial(slopes, curves, factor * slope)
        plots.append(Plot(name, f"{title}: change per 1 % of each parameter.", change))
        family = partial(response_families, curves, sweep.values, factor * response)
        about = f"{title}: response for values of each parameter over its bounds, the others held."
        plots.append(Plot(name.replace("sensitivity", "bounds", 1), about, family))
        header = ("time_s", f"{short}_{unit}", *(f"{p.name}_{unit}_per_pct" for p in free))
        data[f"{name}.csv"] = _csv(header, np.column_stack([time, output, factor * slope.T]))
        rms = factor * np.sqrt(np.mean(slope**2, axis=1))
        rows += [
            (logs[channel.log], f"{short} [{unit}]", p.name, float(r)) for p, r in zip(free, rms, strict=True)
        ]
    note = "rms change of the output for 1 % of the parameter, all others held; –: the simulation diverges."
    table = Table("Sensitivity", ("log", "output", "parameter", "rms per 1 %"), tuple(rows), note)
    section = Section("Effect of each parameter", tables={"sensitivity": table}, plots=tuple(plots))
    return Page("sensitivity", "Sensitivity of the outputs to each parameter", note, (section,), data=data)


def surface_page(surfaces: Sequence[Surface], objective: ObjectiveSettings) -> Page:
    """Return the page of error surfaces: the table `surface` and one CSV per surface."""
    rows: list[tuple[Cell, ...]] = []
    plots: list[Plot] = []
    data: dict[str, str] = {}
    for surface in surfaces:
        first, second = surface.parameters
        name = f"surface_{first.name}_{second.name}"
        caption = f"Error over {first.name} and {second.name}, all other parameters held at the estimate."
        plots.append(Plot(name, caption, partial(contours, surface, objective)))
        a, b = (grid.ravel() for grid in np.meshgrid(*surface.values, indexing="ij"))
        header = (first.name, second.name, "error" if objective.relative else "error_deg")
        error = in_reader_units(objective, surface.error.ravel())
        data[f"{name}.csv"] = _csv(header, np.column_stack([a, b, error]))
        *lowest, least = surface.lowest
        least, at = in_reader_units(objective, np.array([least, surface.estimate_error]))
        rows.append((f"{first.name}, {second.name}", *lowest, float(least), *surface.estimate, float(at)))
    unit = norm_label(objective)
    header = (
        *("parameters", "first, lowest", "second, lowest", f"lowest: {unit}"),
        *("first, estimate", "second, estimate", f"estimate: {unit}"),
    )
    note = "All other parameters are held at the estimate, which is a grid point where the grid reaches it."
    table = Table("Error over two parameters", header, tuple(rows), note)
    section = Section("Lowest points and estimates", tables={"surface": table}, plots=tuple(plots))
    lead = f"{unit.capitalize()} over the whole record, all other parameters held at the estimate."
    return Page("surface", "Error over two parameters", lead, (section,), data=data)


def design_page(arm: Arm, settings: DesignSettings, design: Design, theta: Mapping[str, float]) -> Page:
    """Return the page of a designed experiment at parameters by name; its table is `design`."""
    table = design_table(settings, design, theta)
    margin = np.radians(settings.margin_deg)
    limits = np.column_stack([arm.lower + margin, arm.upper - margin])
    moving = "Commands and the motion that the present estimate predicts."
    precise = "Predicted relative standard deviations, from ±100 % without any log."
    section = Section(
        "Prediction",
        points=(SAFETY,),
        tables={"design": table},
        plots=(
            Plot("motion", moving, partial(motion, design.predicted, arm.joint_names, limits)),
            Plot("precision", precise, partial(precision, design.names, *_deviations(design))),
        ),
    )
    lead = f"The best of {len(design.random)} random experiments and their variations, in simulation."
    return Page("design", "The next experiment", lead, (section,))


def design_table(settings: DesignSettings, design: Design, theta: Mapping[str, float]) -> Table:
    """Return the predicted precision of each parameter before, after a random and the designed experiment."""
    rows: list[tuple[Cell, ...]] = []
    for name, *deviations in zip(design.names, *_deviations(design), strict=True):
        before, random, designed = map(float, deviations)
        flag = flag_of(designed)
        gain = 100 * before, 100 * random, 100 * designed, random / designed
        rows.append((name, theta[name], *gain, "" if flag is Flag.IDENTIFIABLE else flag.value))
    header = ("name", "estimate", "before [%]", "random [%]", "designed [%]", "random / designed", "flag")
    note, optional = _design_note(settings, design), ("random / designed", "estimate")
    return Table("Predicted relative standard deviations", header, tuple(rows), note, optional)


def _design_note(settings: DesignSettings, design: Design) -> str:
    information = design.best.information
    before, _ = design.judge.weakest()
    weakest, direction = design.judge.weakest(information)
    order = [
        i for i in np.argsort(-np.abs(direction)) if abs(direction[i]) >= _SHOWN * np.abs(direction).max()
    ]
    sign = np.sign(direction[order[0]])
    parts = " ".join(f"{sign * direction[i]:+.2f} {design.names[i]}" for i in order).replace("-", "−")
    total, some = len(design.names), design.judge.directions.shape[1]
    lost = "" if some == total else f" (of the {some} of {total} that random experiments depend on)"
    time = settings.noise_correlation_s
    correlation = f" with a correlation time of {time:g} s" if time else ", white"
    return (
        f"Noise {settings.noise_deg:g} deg{correlation}; before: every parameter ±100 % unless logs say more;"
        f" random: median of {len(design.random)} experiments of the same length and limits. Weakest "
        f"direction{lost}: {number(100 * before)} % before, {number(100 * design.random_weakest)} % random, "
        f"{number(100 * weakest)} % designed; it is {parts}. {SAFETY}"
    )


def _deviations(design: Design) -> tuple[Array, Array, Array]:
    """Return standard deviations before, after a random and after the designed experiment, each (F,)."""
    judge = design.judge
    return judge.deviations(), design.random_deviations, judge.deviations(design.best.information)


def _csv(header: tuple[str, ...], rows: Array) -> str:
    return Table("", header, tuple(tuple(map(float, row)) for row in rows)).csv()
