"""Sensitivity, error surfaces and designed experiments to files."""

from pathlib import Path

import numpy as np

from hydroid.experiment.design import Design
from hydroid.files import write_atomic
from hydroid.parameters import Array
from hydroid.problem.problem import Problem
from hydroid.report.channels import file_name, log_names
from hydroid.report.table import Cell, Table, number
from hydroid.report.words import in_reader_units, norm_label
from hydroid.report.write import write_figure, write_table
from hydroid.settings.arm import Arm
from hydroid.settings.experiment import DesignSettings
from hydroid.settings.problem import ObjectiveSettings
from hydroid.uncertainty.flags import WEAK_ABOVE, flag_of
from hydroid.uncertainty.surface import Surface
from hydroid.uncertainty.sweep import Sweep

_READER = {"angle": ("deg", 180 / np.pi), "pressure_a": ("bar", 1e-5), "pressure_b": ("bar", 1e-5)}
_SHORT = {"angle": "q", "pressure_a": "pA", "pressure_b": "pB"}
SHOWN = 0.15
"""components of the weakest direction that are named: at least this part of the largest"""
SAFETY = (
    "The limits were checked on the simulated response only, at the present estimate: the machine moves "
    "otherwise as far as it differs from the model. Collisions with itself, the floor or anything else were "
    "not looked for. Watch the first run with a hand on the stop."
)


def write_sensitivity(out: Path, problem: Problem, theta: Array, found: Sweep) -> Table:
    """Write figure and CSV of every channel, and the rms effects as a table, which is returned.

    Raises:
        RunError: the folder cannot be written.
    """
    from hydroid.report.plots import svg
    from hydroid.report.plots.sensitivity import sheaves, slopes

    logs = log_names([log.source for log in problem.logs])
    free = [problem.parameters.parameters[i] for i in found.free]
    names = [p.name for p in free]
    residual = problem.residuals(theta[None])[0]
    rows: list[tuple[Cell, ...]] = []
    taken: set[str] = set()
    for channel, slope, response in zip(problem.channels, found.slopes, found.responses, strict=True):
        unit, factor = _READER[channel.quantity]
        short, time = f"{_SHORT[channel.quantity]}{channel.joint}", problem.logs[channel.log].time
        output = factor * (channel.measured - residual[channel.rows] / channel.weight)
        name = file_name(f"sensitivity_{Path(logs[channel.log]).stem}_{short}", taken)
        taken.add(name.lower())
        what = "Angle" if channel.quantity == "angle" else f"Pressure {channel.quantity[-1].upper()}"
        about = f"{what} of joint {channel.joint} in {logs[channel.log]}"
        figure = slopes(
            f"{about}: change per 1 % of each parameter", unit, names, time, output, factor * slope
        )
        write_figure(out, name, figure, svg(figure))
        figure = sheaves(
            f"{about}: each parameter over its bounds",
            unit,
            [f"{p.name} [{p.unit}]" if p.unit else p.name for p in free],
            time,
            output,
            found.values,
            factor * response,
        )
        write_figure(out, name.replace("sensitivity", "bounds", 1), figure, svg(figure))
        header = ("time_s", f"{short}_{unit}", *(f"{n}_{unit}_per_pct" for n in names))
        write_atomic(out / f"{name}.csv", _csv(header, np.column_stack([time, output, factor * slope.T])))
        rms = factor * np.sqrt(np.mean(slope**2, axis=1))
        rows += [
            (logs[channel.log], f"{short} [{unit}]", n, float(r)) for n, r in zip(names, rms, strict=True)
        ]
    note = "rms change of the output for 1 % of the parameter, all others held; a dash: it diverges."
    table = Table("Sensitivity", ("log", "output", "parameter", "rms per 1 %"), tuple(rows), note)
    write_table(out, "sensitivity", table)
    return table


def write_surface(out: Path, found: Surface, how: ObjectiveSettings) -> tuple[Cell, ...]:
    """Write a surface's figure and CSV; return its row of `surface_table`.

    Raises:
        RunError: the folder cannot be written.
    """
    from hydroid.report.plots import svg
    from hydroid.report.plots.surface import contours

    first, second = found.parameters
    name = f"surface_{first.name}_{second.name}"
    figure = contours(found, how)
    write_figure(out, name, figure, svg(figure))
    a, b = (grid.ravel() for grid in np.meshgrid(*found.values, indexing="ij"))
    error = in_reader_units(how, found.error.ravel())
    header = (first.name, second.name, "error" if how.relative else "error_deg")
    write_atomic(out / f"{name}.csv", _csv(header, np.column_stack([a, b, error])))
    best, at = found.lowest, in_reader_units(how, np.array([found.lowest[2], found.estimate_error]))
    return (f"{first.name}, {second.name}", best[0], best[1], float(at[0]), *found.estimate, float(at[1]))


def surface_table(out: Path, rows: list[tuple[Cell, ...]], how: ObjectiveSettings) -> Table:
    """Write and return the table of the lowest points beside the estimates."""
    unit = norm_label(how)
    header = (
        *("parameters", "first, lowest", "second, lowest", f"lowest of the grid: {unit}"),
        *("first, estimate", "second, estimate", f"estimate: {unit}"),
    )
    note = "All other parameters are held at the estimate; the lowest point is one of the grid."
    table = Table("Error over two parameters", header, tuple(rows), note)
    write_table(out, "surface", table)
    return table


def write_design(out: Path, arm: Arm, how: DesignSettings, found: Design, theta: dict[str, float]) -> Table:
    """Write a design's figures and its table of predicted precision, which is returned.

    Raises:
        RunError: the folder cannot be written.
    """
    from hydroid.report.plots import svg
    from hydroid.report.plots.design import motion, precision

    margin = np.radians(how.margin_deg)
    moved = found.predicted
    figures = {
        "motion": motion(moved, arm.joint_names, arm.lower + margin, arm.upper - margin),
        "precision": precision(found.names, *_deviations(found), WEAK_ABOVE),
    }
    for name, figure in figures.items():
        write_figure(out, name, figure, svg(figure))
    table = design_table(how, found, theta)
    write_table(out, "design", table)
    return table


def design_table(how: DesignSettings, found: Design, theta: dict[str, float]) -> Table:
    """Predicted precision of each parameter before, after a random and after the designed experiment."""
    rows: list[tuple[Cell, ...]] = [
        (
            *(name, theta[name], 100 * float(b), 100 * float(r), 100 * float(d), float(r / d)),
            "" if d <= WEAK_ABOVE else flag_of(float(d)).value,
        )
        for name, b, r, d in zip(found.names, *_deviations(found), strict=True)
    ]
    header = (
        *("name", "estimate", "before [%]", "random [%]", "designed [%]", "random / designed"),
        "flag",
    )
    return Table("Predicted relative standard deviations", header, tuple(rows), _design_note(how, found))


def _design_note(how: DesignSettings, found: Design) -> str:
    told = found.best.information
    before, _ = found.judge.weakest()
    weakest, direction = found.judge.weakest(told)
    order = [
        i for i in np.argsort(-np.abs(direction)) if abs(direction[i]) >= SHOWN * np.abs(direction).max()
    ]
    sign = np.sign(direction[order[0]])
    parts = " ".join(f"{sign * direction[i]:+.2f} {found.names[i]}" for i in order).replace("-", "−")
    total, some = len(found.names), found.judge.directions.shape[1]
    lost = "" if some == total else f" (of the {some} of {total} that random experiments tell at all)"
    memory = f", correlated over {how.noise_correlation_s:g} s" if how.noise_correlation_s else ", white"
    return (
        f"Noise {how.noise_deg:g} deg{memory}; every parameter is taken for ±100 % before; random: median of "
        f"{len(found.random)} experiments of the same length and limits. Weakest direction{lost}: "
        f"{number(100 * before)} % before, {number(100 * found.random_weakest)} % random, "
        f"{number(100 * weakest)} % designed; it is {parts}. {SAFETY}"
    )


def _deviations(found: Design) -> tuple[Array, Array, Array]:
    """Before, after a random and after the designed experiment, each of shape (F,)."""
    judge = found.judge
    return judge.deviations(), found.random_deviations, judge.deviations(found.best.information)


def _csv(header: tuple[str, ...], rows: Array) -> str:
    return Table("", header, tuple(tuple(map(float, row)) for row in rows)).csv()
