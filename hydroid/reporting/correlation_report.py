"""Which parameters can stand in for each other: the correlations of their estimates."""

from collections.abc import Iterator
from functools import partial

import numpy as np

from hydroid.arrays import Array
from hydroid.estimate import Covariance, FitSummary
from hydroid.reporting.chart import Chart, Mark, Panel
from hydroid.reporting.page import Plot, Section, Table
from hydroid.reporting.parameters_report import by_joint, first_joint
from hydroid.settings.fit import FitSettings
from hydroid.settings.naming import named

FAINT = 0.1
"""correlation below which a cell stays empty"""
STRONG = 0.9
"""correlation from which two parameters are named"""
NOTABLE = 0.3
"""correlation from which the map of a joint shows the parameters of others"""
READABLE = 40
"""parameters whose names can be read in one map"""
MOST = 6
"""pairs that are named"""
ROW = 18
"""height of a row [px]"""
LARGEST = 760
"""height of all rows together, at most [px]"""
LETTER = 7
"""length of a letter of the columns' names, which stand upright below the rows [px]"""

_TEXT = (
    "Where two parameters are correlated, one can make up for the other: the logs determine "
    "them together better than each alone. Blue: both may be larger together. Orange: one may"
    " be larger if the other is smaller."
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
    covariance = summary.covariance
    if covariance is None or not covariance.parameters:
        return None
    names = covariance.parameters
    matrix = correlations(covariance).tolist()
    rows = tuple((name, *row) for name, row in zip(names, matrix, strict=True))
    return Table("", ("symbol", *names), rows)


def correlation_section(settings: FitSettings, summary: FitSummary) -> Section | None:
    """Return the section of the correlations as a map of colours.

    None where fewer than two vary.
    """
    covariance = summary.covariance
    if covariance is None or len(covariance.parameters) < 2:
        return None
    names = tuple(by_joint(settings, covariance.parameters))
    order = [covariance.parameters.index(name) for name in names]
    matrix = correlations(covariance)[np.ix_(order, order)]
    pairs = strongest(matrix, names)
    points = tuple(
        f"{named(settings, first)} and {named(settings, second)}: {value:+.2f}"
        for first, second, value in pairs
    )
    answer = "no pair is strongly correlated"
    if points:
        first, second, value = pairs[0]
        answer = f"strongest: {first} and {second}, {value:+.2f}"
    title = "Which parameters are correlated?"
    tabs = tuple(_maps(settings, matrix, names))
    return Section(title, _TEXT, points, tabs=tabs, folded=True, answer=answer)


def _maps(
    settings: FitSettings, matrix: Array, names: tuple[str, ...]
) -> Iterator[Plot]:
    """Yield the map of all parameters, or, where these are too many to be read, a map
    for each joint: its parameters, and those of others that are correlated with them."""
    if len(names) <= READABLE:
        draw = partial(correlation_map, matrix, names)
        yield Plot("correlation", "Correlations of the estimates.", draw)
        return
    joints = [first_joint(settings, name) for name in names]
    for number in sorted(set(joints)):
        is_own = np.array(joints) == number
        correlated = np.abs(matrix[is_own]).max(axis=0) >= NOTABLE
        shown = np.flatnonzero(is_own | correlated)
        own = tuple(names[i] for i in shown)
        draw = partial(correlation_map, matrix[np.ix_(shown, shown)], own)
        button = "shared by all"
        if number:
            button = settings.arm.name_of(number)
        caption = f"Correlations of the estimates: {button}"
        yield Plot(f"correlation_{number}", caption, draw, button=button)


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
    below = 30 + LETTER * max(map(len, names))
    height = below + min(ROW * len(names), LARGEST)
    return Chart((Panel("", "", (cells,), height=height, rows=names, columns=names),))
