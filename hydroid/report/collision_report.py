"""The report of a trajectory: which bodies meet, and how near they come over time."""

from functools import partial

import numpy as np
from matplotlib.figure import Figure

from hydroid.arm.collision import Clearance, Meeting
from hydroid.report import style
from hydroid.report.page import Page, Plot, Section
from hydroid.report.table import Cell, Table

NAMED = 5
"""pairs of bodies that have a colour of their own in the figure"""
SHAPES = (
    "Bodies are as large as the shapes that collide in the MJCF; a mesh counts as its convex hull, hoses and "
    "cylinders are not checked. A body is not held against the one that it hangs on."
)


def collision_page(clearance: Clearance, name: str) -> Page:
    """Return the page of a trajectory of an arm; its tables are `nearest` and `collisions`."""
    plot = Plot("clearance", "Smallest distance between bodies.", partial(clearance_figure, clearance))
    tables = {"nearest": nearest_table(clearance)}
    if clearance.meetings:
        tables = {"collisions": collision_table(clearance)} | tables
    sections = Section("Clearance", text=SHAPES, plots=(plot,)), Section("Bodies", tables=tables)
    return Page("collisions", f"Collisions of {name}", verdict(clearance), sections)


def verdict(clearance: Clearance) -> str:
    """Return the answer in a sentence."""
    k = clearance.smallest
    pair, at = " and ".join(clearance.nearest[k]), f"at {clearance.time[k]:.2f} s"
    size = f"{1e3 * abs(clearance.distance[k]):.1f} mm"
    if not clearance.meetings:
        return f"No bodies meet. The nearest are {pair}: {size} {at}."
    first, met = clearance.meetings[0], clearance.distance < 0
    times = int(np.sum(met[1:] & ~met[:-1]) + met[0])
    return (
        f"Bodies meet {'once' if times == 1 else f'{times} times'}, first {first.first} and {first.second} "
        f"at {first.begins:.2f} s. The deepest inside each other are {pair}: {size} {at}."
    )


def collision_table(clearance: Clearance) -> Table:
    """Return the pairs of bodies that met."""
    met: dict[tuple[str, str], list[Meeting]] = {}
    for meeting in clearance.meetings:
        met.setdefault((meeting.first, meeting.second), []).append(meeting)
    rows: list[tuple[Cell, ...]] = []
    for pair, times in met.items():
        worst = max(times, key=lambda meeting: meeting.depth)
        rows.append((*pair, len(times), times[0].begins, times[0].ends, 1e3 * worst.depth, worst.deepest))
    header = ("first", "second", "times", "first from [s]", "to [s]", "depth [mm]", "at [s]")
    note = "depth: the largest of all times. --json lists every time."
    return Table("Bodies that meet", header, tuple(rows), note)


def nearest_table(clearance: Clearance) -> Table:
    """Return the pairs of bodies that were the nearest at any time."""
    at: dict[tuple[str, str], list[int]] = {}
    for sample, pair in enumerate(clearance.nearest):
        at.setdefault(pair, []).append(sample)
    rows: list[tuple[Cell, ...]] = []
    for pair, samples in at.items():
        least = samples[int(np.argmin(clearance.distance[samples]))]
        share = 100 * len(samples) / len(clearance.time)
        rows.append((*pair, 1e3 * clearance.distance[least], float(clearance.time[least]), share))
    rows.sort(key=lambda row: float(row[2] or 0.0))
    excluded = ", ".join("–".join(pair) for pair in clearance.excluded)
    note = f"{clearance.checked} pairs of bodies were checked. The model excludes: {excluded or 'none'}."
    header = ("first", "second", "smallest distance [mm]", "at [s]", "share of the time [%]")
    return Table("Nearest bodies", header, tuple(rows), note)


def clearance_figure(clearance: Clearance) -> Figure:
    """Draw the smallest distance over time, coloured by the bodies that it lies between."""
    drawing = style.figure(3.0, 7.4)
    axes = drawing.subplots()
    time, distance = clearance.time, 1e3 * clearance.distance
    axes.fill_between(time, np.minimum(distance, 0.0), 0.0, color="#B22222", alpha=0.25, linewidth=0)
    axes.axhline(0.0, color=style.MEASURED, linewidth=1.0)
    pairs = [tuple(str(cell) for cell in row[:2]) for row in nearest_table(clearance).rows]
    colors = (style.REFINED, style.SEARCH, *style.OTHERS)[:NAMED]
    for pair, color in zip(pairs, colors, strict=False):
        own = np.array([other == pair for other in clearance.nearest])
        own[:-1] |= own[1:]  # up to where the next pair begins
        axes.plot(time, np.where(own, distance, np.nan), color=color, label=" – ".join(pair), linewidth=1.8)
    if len(pairs) > NAMED:
        known = np.array([other in pairs[:NAMED] for other in clearance.nearest])
        axes.plot(time, np.where(known, np.nan, distance), color=style.GREY, label="others")
    axes.set_xlabel("time [s]")
    axes.set_ylabel("smallest distance [mm]")
    axes.set_title("Distance of the nearest bodies; below 0 they are inside each other")
    axes.margins(x=0)
    style.legend_below(drawing, axes, columns=3)
    return drawing
