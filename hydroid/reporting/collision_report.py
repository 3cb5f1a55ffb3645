"""Tables of a trajectory: which bodies meet, and how near they come over time."""

from itertools import groupby

from hydroid.arm.collision import Clearance, Meeting
from hydroid.reporting.table import Cell, Table

SHAPES = (
    "Bodies are as large as the shapes that collide in the MJCF; a mesh counts as its convex hull, hoses and "
    "cylinders are not checked. A body is not held against the one that it hangs on."
)


def summary(clearance: Clearance) -> str:
    """Return the answer in a sentence."""
    k = clearance.smallest
    pair, at = " and ".join(clearance.nearest[k]), f"at {clearance.time[k]:.2f} s"
    size = f"{1e3 * abs(clearance.distance[k]):.1f} mm"
    if not clearance.meetings:
        return f"No bodies meet. The nearest are {pair}: {size} {at}."
    first, times = clearance.meetings[0], sum(met for met, _ in groupby(clearance.distance < 0))
    return (
        f"Bodies meet {'once' if times == 1 else f'{times} times'}, first {first.first} and {first.second} "
        f"at {first.begins:.2f} s. The deepest inside each other are {pair}: {size} {at}."
    )


def collision_table(clearance: Clearance) -> Table:
    """Return the pairs of bodies that met."""
    pairs: dict[tuple[str, str], list[Meeting]] = {}
    for meeting in clearance.meetings:
        pairs.setdefault((meeting.first, meeting.second), []).append(meeting)
    rows: list[tuple[Cell, ...]] = []
    for pair, times in pairs.items():
        worst = max(times, key=lambda meeting: meeting.depth)
        rows.append((*pair, len(times), times[0].begins, times[0].ends, 1e3 * worst.depth, worst.deepest))
    header = ("first", "second", "times", "first from [s]", "to [s]", "depth [mm]", "at [s]")
    note = f"depth: the largest of all times. --json lists every time. {SHAPES}"
    return Table("Bodies that meet", header, tuple(rows), note)
