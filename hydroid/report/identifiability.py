"""What a fit's logs determine, for a reader: directions, noise, and their section of a report."""

from collections.abc import Mapping

import numpy as np

from hydroid.problem.problem import Problem
from hydroid.report.channels import log_names
from hydroid.report.html import Picture, Section
from hydroid.report.phrases import direction_phrase
from hydroid.report.table import Cell, Table
from hydroid.uncertainty.covariance import Uncertainty
from hydroid.uncertainty.directions import Identifiability
from hydroid.uncertainty.flags import WEAK_ABOVE

FIGURES = {
    "singular_values": "How strongly each direction is felt, in units of the noise: the inverse of its "
    "relative standard deviation. Below the line it is not determined to 30 %; a hollow mark at the foot: "
    "not felt at all.",
    "directions": "The directions themselves, best determined first: relative changes that belong together.",
    "profiles": "Profile likelihood: the rise of the error, in units of the noise, where a parameter is held "
    "and the others are fitted anew. Below the line is its interval; dashed: the linear approximation.",
    "correlation": "Correlation of the estimates: near ±1 only a combination of the two is known. Blank: not "
    "determined.",
}
_SHOWN = 0.1


def direction_table(found: Identifiability) -> Table:
    """Every direction with its standard deviation and its largest components, best determined first."""
    rows: list[tuple[Cell, ...]] = []
    for value, axis in zip(found.singular, found.axes, strict=True):
        order = [i for i in np.argsort(-np.abs(axis), kind="stable") if abs(axis[i]) >= _SHOWN]
        parts = ", ".join(f"{found.names[i]} {axis[i]:+.2f}".replace("-", "−") for i in order)
        rows.append((float(value), 100 / value if value > 0 else np.inf, parts))
    note = (
        f"Relative changes of unit length, in units of the noise. {found.rank} of {len(found.names)} have a "
        f"standard deviation of {100 * WEAK_ABOVE:.0f} % or less."
    )
    header = ("singular value", "standard deviation [%]", "relative changes that belong together")
    return Table("Directions", header, tuple(rows), note)


def noise_table(problem: Problem, found: Uncertainty) -> Table:
    """The noise of every channel, and where it was taken from."""
    names = log_names([log.source for log in problem.logs])
    rows: list[tuple[Cell, ...]] = []
    for channel, noise in zip(problem.channels, found.noise, strict=True):
        angle = channel.quantity == "angle"
        factor = (np.degrees(1) if angle else 1e-5) / channel.weight
        left = factor * float(np.sqrt(np.mean(found.jacobian.residual[channel.rows] ** 2)))
        rows.append(
            (
                names[channel.log],
                channel.joint,
                f"{channel.quantity.replace('_', ' ')} [{'deg' if angle else 'bar'}]",
                left,
                factor * noise.level,
                noise.correlation_time * problem.logs[channel.log].period,
                noise.effective_sample_size,
                noise.source,
            )
        )
    header = (
        "log",
        "joint",
        "signal",
        "rms left over",
        "noise",
        "memory [s]",
        "independent samples",
        "taken from",
    )
    note = (
        "memory: time after which the noise's autocorrelation is below 1/e; independent samples: "
        "without memory as many would tell its level as well."
    )
    return Table("Noise", header, tuple(rows), note)


def told_section(
    text: str, problem: Problem, found: Uncertainty, told: Identifiability, figures: Mapping[str, bytes]
) -> Section:
    """The section of a page: weak directions in words, tables, figures (SVG by name)."""
    return Section(
        "What the data determine",
        text,
        tables=(direction_table(told), noise_table(problem, found)),
        pictures=tuple(
            Picture(figures[name], caption) for name, caption in FIGURES.items() if name in figures
        ),
        points=tuple(direction_phrase(d, problem) for d in told.unidentifiable),
    )
