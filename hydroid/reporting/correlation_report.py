"""Which parameters trade against each other: the correlations of their estimates."""

from functools import partial

import numpy as np

from hydroid.arrays import Array
from hydroid.estimate import Covariance, FitSummary
from hydroid.reporting.chart import Chart, Mark, Panel
from hydroid.reporting.page import Plot, Section, Table
from hydroid.settings.fit import FitSettings
from hydroid.settings.naming import named

FAINT = 0.1
"""correlation below which a cell stays empty"""
STRONG = 0.9
"""correlation from which two parameters are named"""
MOST = 6
"""pairs that are named"""
ROW = 18
"""height of a row [px]"""
LARGEST = 760
"""height of all rows together, at most [px]"""

_TEXT = (
    "Two parameters that are correlated trade against each other: the logs know a combination of them better "
    "than either. Blue: both may grow together; orange: one grows while the other falls."
)


def correlations(covariance: Covariance) -> Array:
    """Return the correlations of the estimates of the p parameters, shape (p, p)."""
    inverse = np.linalg.inv(np.array(covariance.root))
    matrix = inverse @ inverse.T
    deviations = np.sqrt(np.diag(matrix))
    return matrix / np.outer(deviations, deviations)


def correlation_table(summary: FitSummary) -> Table | None:
    """Return the correlations as a table, for scripts; None: the summary has no
    covariance."""
    known = summary.covariance
    if known is None or not known.parameters:
        return None
    rows = zip(known.parameters, correlations(known).tolist(), strict=True)
    return Table(
        "", ("symbol", *known.parameters), tuple((name, *row) for name, row in rows)
    )


def correlation_section(settings: FitSettings, summary: FitSummary) -> Section | None:
    """Return the section of the correlations as a map of colours.

    None where fewer than two vary.
    """
    known = summary.covariance
    if known is None or len(known.parameters) < 2:
        return None
    order = _by_joint(settings, known.parameters)
    matrix = correlations(known)[np.ix_(order, order)]
    names = tuple(known.parameters[i] for i in order)
    pairs = strongest(matrix, names)
    points = tuple(
        f"{named(settings, first)} and {named(settings, second)}: {_signed(value)}"
        for first, second, value in pairs
    )
    plot = Plot(
        "correlation",
        "Correlations of the estimates.",
        partial(correlation_map, matrix, names),
    )
    answer = "no pair is strongly correlated"
    if points:
        first, second, value = pairs[0]
        answer = f"strongest: {first} and {second}, {_signed(value)}"
    title = "Which parameters trade?"
    return Section(title, _TEXT, points, plots=(plot,), folded=True, answer=answer)


def strongest(matrix: Array, names: tuple[str, ...]) -> list[tuple[str, str, float]]:
    """Return the pairs of the strongest correlations, from STRONG on, the strongest
    first."""
    rows, columns = np.tril_indices(len(matrix), -1)
    values = matrix[rows, columns]
    order = np.argsort(-np.abs(values), kind="stable")[:MOST]
    chosen = [i for i in order.tolist() if abs(values[i]) >= STRONG]
    return [(names[columns[i]], names[rows[i]], float(values[i])) for i in chosen]


def correlation_map(matrix: Array, names: tuple[str, ...]) -> Chart:
    """Draw the lower half of correlations, shape (p, p), in colours."""
    rows, columns = np.nonzero(np.tril(np.abs(matrix) >= FAINT))
    values = np.clip(matrix[rows, columns], -1.0, 1.0)
    cells = Mark("cells", columns.astype(float), rows.astype(float), values)
    height = 60 + min(ROW * len(names), LARGEST) + (60 if len(names) <= 40 else 0)
    return Chart((Panel("", "", (cells,), height=height, rows=names, columns=names),))


def _by_joint(settings: FitSettings, names: tuple[str, ...]) -> list[int]:
    """Return the places of parameters in the order of their joints, so that those of
    one stand together.
    """

    def joint(i: int) -> int:
        own = settings.parameters.get(names[i])
        return own.joints[0] if own is not None and own.joints else 0

    return sorted(range(len(names)), key=joint)


def _signed(value: float) -> str:
    return f"{value:+.2f}".replace("-", "−")
