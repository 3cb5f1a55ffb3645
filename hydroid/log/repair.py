"""A recording's samples -> one period: repairs that invent no data, then commands held,
angles interpolated.

Each command holds until the next one. Where samples are not the new ones, by jitter or
another rate, commands are averaged over each new sample: the arm has felt all of them,
each for as long as it held.

A faster log is thinned by plain interpolation of its angles, without a filter before
it: the fit compares angles sample by sample, and white sensor noise stays what it was,
while a filter would colour it and delay the angle.
"""

from dataclasses import replace
from itertools import pairwise

import numpy as np

from hydroid.arrays import Array
from hydroid.errors import LogError
from hydroid.log.conditions import relative
from hydroid.log.log import FileRows, Log, LogFinding
from hydroid.log.rates import LEAST_EMPTY, join_rates
from hydroid.log.table import Recording, Signal, number
from hydroid.settings.log import LogSettings

GAP = 1.95
"""in sample periods: a longer step is a gap, a shorter one jitter; one dropped sample
makes it 2"""
BRIDGED = 3.05
"""in periods of the samples or of the settings: a gap that is no longer is bridged"""
SHORTEST = 0.5
"""duration of a log [s]"""
LEAST_PERIODS = 5
"""of the settings in a log: of fewer samples no motion can be seen"""
TURN = 2 * np.pi
ROUNDING = 1 + 1e-9
"""by which a gap may be longer than the settings allow, as its times are rounded"""
MOST_LEFT_OUT = 0.05
"""part of the rows that may hold no numbers"""
MOST_AGAIN = 0.005
"""part of the rows that may stand at a time which has been: more are a clock that was
set back"""
NO_COMMAND = 1e-3
"""below which a command is none [%]"""
FINER = 0.8
"""part of a log's period up to which a grid is finer than the log"""


def sample_period(time: Array) -> float:
    """Return the usual step between samples [s]; NaN where there is none."""
    steps = np.diff(time[~np.isnan(time)])
    # a row that stands twice has a step of 0
    rising = steps[steps > 0]
    if not len(rising):
        return np.nan
    return float(np.median(rising))


def unwrap(recording: Recording, findings: list[LogFinding]) -> Recording:
    """Join angles where they jump by one turn, as an encoder's do.

    No continuous joint turns by 180 deg within one sample: other jumps are errors. Of a
    joint with a range, angles are joined if all of them lie within the range then.
    """
    values = recording.values
    for place, signal in enumerate(recording.signals):
        if signal.kind != "angle" or signal.unit != "deg":
            continue
        column = values[:, place]
        rows = np.flatnonzero(~np.isnan(column))
        after = rows[1:]
        steps = np.diff(column[rows])
        # an eighth of a turn is left for the motion within one sample
        wraps = np.abs(np.abs(steps) - TURN) < np.pi / 4
        jumps = (np.abs(steps) > np.pi) & ~wraps
        is_continuous = not np.isfinite(signal.high)
        joined = column
        if wraps.any():
            joined = column.copy()
            joined[after] -= TURN * np.cumsum(np.sign(steps) * wraps)
        if not is_continuous:
            joined = _within_range(signal, joined)
        if wraps.any() and joined is not None:
            if values is recording.values:
                values = values.copy()
            values[:, place] = joined
            findings.append(recording.finding("note", "wrap", after[wraps], signal))
        if is_continuous and jumps.any():
            step = np.rad2deg(steps[jumps][0])
            findings.append(
                recording.finding(
                    "error",
                    "jump",
                    after[jumps],
                    signal,
                    step=step,
                    setting=signal.setting,
                )
            )
    return replace(recording, values=values)


def _within_range(signal: Signal, angle: Array) -> Array | None:
    """Return an angle, (R,), by whole turns moved into the range of its joint [rad];
    None where it does not fit in."""
    middle = 0.5 * (signal.low + signal.high)
    there = angle[~np.isnan(angle)]
    if not len(there):
        return None
    middle_now = 0.5 * (there.min() + there.max())
    turns = np.rint((middle - middle_now) / TURN)
    moved = angle + TURN * turns
    is_inside = np.isnan(moved) | ((signal.low <= moved) & (moved <= signal.high))
    return moved if is_inside.all() else None


def fill(recording: Recording, longest: float, findings: list[LogFinding]) -> Recording:
    """Interpolate angles and hold commands in holes of at most `longest` [s] besides
    the usual step.

    Rows without a time are dropped. Samples that were never recorded are counted:
    `resample` bridges them.
    """
    timed = ~np.isnan(recording.time)
    values = recording.values[timed]
    time = values[:, 0]
    empty = np.isnan(values)
    period = sample_period(time)
    reach = longest * ROUNDING + period
    columns = values.T[1:]
    for signal, column in zip(recording.signals[1:], columns, strict=True):
        there = ~np.isnan(column)
        # times of the last cell with a number, and of the next one
        before = np.maximum.accumulate(np.where(there, time, -np.inf))
        after = np.where(there, time, np.inf)
        after = np.minimum.accumulate(after[::-1])[::-1]
        holes = ~there & (after - before <= reach)
        if signal.kind == "command":
            last = np.maximum.accumulate(there * np.arange(len(time)))
            column[holes] = column[last[holes]]
        elif holes.any():
            column[holes] = np.interp(time[holes], time[there], column[there])
    steps = np.diff(time)
    bridged = steps[(steps > GAP * period) & (steps <= reach)]
    samples = np.rint(bridged / period - 1).sum()
    cells = float((empty & ~np.isnan(values)).sum())
    lost = float((~timed).sum())
    if samples or cells or lost:
        findings.append(
            recording.finding(
                "warning", "repair", cells=cells, samples=samples, lost=lost
            )
        )
    return replace(recording, values=values, rows=recording.rows[timed])


def without_bad_rows(
    recording: Recording,
    settings: LogSettings,
    findings: list[LogFinding],
    *,
    repair: bool,
) -> Recording:
    """Return the rows that can be used, with angles unwrapped and, on request, holes
    filled.

    A row is left out if a cell in it holds no number, or if its time does not follow
    that of the rows before. Where many rows are such, none is left out: the file holds
    something else than the settings say.
    """
    if repair:
        recording = fill(unwrap(recording, findings), settings.repair_s, findings)
    else:
        recording = unwrap(without_cut_end(recording, findings), findings)
        recording = join_rates(recording, findings)
    empty = np.isnan(recording.values)
    bad = empty.any(axis=1)
    if bad.sum() > max(MOST_LEFT_OUT * len(empty), 1):
        return recording
    if bad.any():
        rows = np.flatnonzero(bad)
        signal = None
        what = f"does not hold {len(recording.table.names)} cells with numbers"
        if not empty[rows[0]].all():
            signal = recording.signals[int(empty[rows[0]].argmax())]
            what = _fault(signal, recording, int(recording.rows[rows[0]]))
        findings.append(
            recording.finding("warning", "row left out", rows, signal, what=what)
        )
        recording = recording.kept(np.flatnonzero(~bad))
    return _in_order(recording, findings)


def _fault(signal: Signal, recording: Recording, row: int) -> str:
    """Return why the cell of a signal in a row of the table holds no value."""
    table = recording.table
    cell = table.text(signal.name, row)
    # a text format keeps the text of its cells, others keep numbers
    value = number(cell)
    if not cell and signal.name in table.columns:
        value = table.columns[signal.name][row]
    if value == 0:
        return "0 is no command in this range, but a lost signal"
    return f"{cell[:30]!r} is not a number" if cell else "no value is there"


def _in_order(recording: Recording, findings: list[LogFinding]) -> Recording:
    """Leave out rows whose time has been, if they are few or repeat the row before."""
    time = recording.time
    again = time[1:] <= np.maximum.accumulate(time)[:-1]
    # a logger that writes a sample twice says nothing wrong
    repeats = (recording.values[1:] == recording.values[:-1]).all(axis=1)
    if (again & ~repeats).sum() > max(MOST_AGAIN * len(time), 1):
        return recording
    rows = 1 + np.flatnonzero(again)
    if not len(rows):
        return recording
    first = rows[0]
    what = (
        f"time does not increase: {time[first]:.6g} s follows {time[first - 1]:.6g} s"
    )
    findings.append(
        recording.finding(
            "warning", "row left out", rows, recording.signals[0], what=what
        )
    )
    return recording.kept(np.delete(np.arange(len(time)), rows))


def without_cut_end(recording: Recording, findings: list[LogFinding]) -> Recording:
    """Leave out the last row if it is cut off, as when a logger is killed: its last
    cell holds no number."""
    table = recording.table
    rows = len(recording.values)
    if table.header is None or rows < 2:
        return recording
    before, last = np.isnan(recording.values[-2:])
    is_cut = last.all()
    for signal, column in zip(recording.signals, recording.values.T, strict=True):
        # an empty cell of a slower channel says nothing
        is_slower = np.isnan(column).mean() > LEAST_EMPTY
        if signal.name == table.names[-1] and not is_slower:
            is_cut |= bool(np.isnan(column[-1]))
    # an empty row before the last one is no sign of a logger that was killed
    if not is_cut or before.all():
        return recording
    findings.append(recording.finding("warning", "cut end", [rows - 1]))
    return recording.kept(slice(None, -1))


def between_gaps(
    recording: Recording,
    settings: LogSettings,
    findings: list[LogFinding],
    *,
    repair: bool,
) -> list[Recording]:
    """Return the parts of a recording between gaps, without those that are too short
    (`shortest`).

    Gaps of up to two samples, or with `repair` of up to `settings.repair_s` besides the
    usual step, are none: `resample` bridges them. Raises LogError: no part is long
    enough.
    """
    time = recording.time
    signal = recording.signals[0]
    steps = np.diff(time)
    period = sample_period(time)
    bridged = BRIDGED * max(period, settings.period_s)
    if repair:
        bridged = max(bridged, settings.repair_s * ROUNDING + period)
    lost = 1 + np.flatnonzero((steps > GAP * period) & (steps <= bridged))
    if len(lost) and not repair:
        samples = np.rint(steps[lost - 1] / period - 1).sum()
        findings.append(
            recording.finding("warning", "lost", lost, signal, samples=float(samples))
        )
    gaps = 1 + np.flatnonzero(steps > bridged)
    ends = [0, *gaps.tolist(), len(time)]
    parts = list[Recording]()
    least = shortest(settings)
    too_short = 0
    for first, end in pairwise(ends):
        if time[end - 1] - time[first] >= least:
            parts.append(recording.kept(slice(first, end)))
        else:
            too_short += 1
    if not parts:
        what = f"has no part of {least:g} s{of_periods(settings)} without a gap"
        hint = "log at a higher rate, or use --repair"
        raise LogError(what, recording.table.source, hint)
    if len(gaps):
        numbers = {
            "gap": time[gaps[0]] - time[gaps[0] - 1],
            "period": period,
            "parts": float(len(parts)),
        }
        left = ""
        if too_short:
            left = f", {too_short} shorter than {least:g} s left out"
        findings.append(
            recording.finding("warning", "gap", gaps, signal, **numbers, left=left)
        )
    return parts


def shortest(settings: LogSettings) -> float:
    """Return how long a log, or its part between gaps, must be [s]."""
    return max(SHORTEST, LEAST_PERIODS * settings.period_s)


def of_periods(settings: LogSettings) -> str:
    """Return the words for `shortest` where the settings' period decides it; else
    none."""
    if shortest(settings) == SHORTEST:
        return ""
    return f" ({LEAST_PERIODS} times log.period_s, {settings.period_s:g} s)"


def resample(recording: Recording, settings: LogSettings, joints: int) -> Log:
    """Bring a recording without holes to the period of the settings, from its first
    sample to its last.

    Commands act `settings.delay_s` later than logged, and are 0 % before the first one
    acts. On a finer grid they change on a line from sample to sample: when between them
    is not known.
    """
    period = settings.period_s
    time = recording.time - recording.time[0]
    # the last sample counts where jitter makes it early by a hundredth
    last = int(time[-1] / period + 0.01)
    grid = period * np.arange(last + 1, dtype=np.float64)
    exact = on_grid(time, period)
    if exact is not None:
        # values pass unchanged
        time = exact
    angle = np.full((len(grid), joints), np.nan)
    pressure: Array | None = None
    if any(signal.kind == "pressure" for signal in recording.signals):
        pressure = np.full((len(grid), joints, 2), np.nan)
    columns = recording.values.T[1:]
    for signal, values in zip(recording.signals[1:], columns, strict=True):
        joint = signal.joint - 1
        if signal.kind == "angle":
            angle[:, joint] = np.interp(grid, time, values)
        elif pressure is not None and signal.kind == "pressure":
            pressure[:, joint, signal.part] = np.interp(grid, time, values)
    command = np.zeros((len(grid), joints))
    at = grid - settings.delay_s
    for joint, values in _commands(recording).items():
        command[:, joint] = _resampled(time, values, at, period)
    rows = np.rint(time / period).astype(np.int64)
    rows = np.minimum(rows, last)
    recorded = np.zeros(len(grid), dtype=bool)
    recorded[rows] = True
    steps = np.diff(recording.time)
    ends = float(steps.min()), sample_period(recording.time), float(steps.max())
    return Log(
        source=recording.table.source,
        time=grid,
        command=command.clip(-100, 100, out=command),
        angle=angle,
        period=period,
        pressure=pressure,
        conditions=relative(recording, grid, time),
        recorded=None if recorded.all() else recorded,
        rows=FileRows(len(steps) + 1, ends),
    )


def _commands(recording: Recording) -> dict[int, Array]:
    """Return the command of each joint (0-based) in every sample [%], (R,)."""
    commands = dict[int, Array]()
    shifted = set[int]()
    columns = recording.values.T
    for signal, values in zip(recording.signals, columns, strict=True):
        if signal.kind != "command":
            continue
        joint = signal.joint - 1
        sign = 1.0
        if signal.part:
            sign = -1.0
        commands[joint] = commands.get(joint, 0.0) + sign * values
        if signal.offset:
            shifted.add(joint)
    for joint, values in commands.items():
        # a scale and an offset in a few digits do not give 0 at rest
        if joint in shifted:
            values = np.where(np.abs(values) < NO_COMMAND, 0.0, values)
        # amplifiers and converters overshoot
        commands[joint] = values.clip(-100, 100)
    return commands


def _resampled(time: Array, command: Array, at: Array, period: float) -> Array:
    """Return a command for a period from each time in `at` [s]."""
    is_finer = period <= FINER * sample_period(time)
    if is_finer:
        return np.interp(at + 0.5 * period, time, command, left=0.0)
    return hold(time, command[:, None], at, period)[:, 0]


def on_grid(time: Array, period: float) -> Array | None:
    """Return times as multiples of a period; None if any is off by more than 1 % of the
    period."""
    steps = np.rint(time / period)
    off = np.abs(time / period - steps)
    if not (off <= 0.01).all():
        return None
    return period * steps


def hold(time: Array, command: Array, at: Array, period: float) -> Array:
    """Return the command for a period from each time in `at` [s]; 0 before the first,
    shape (len(at), J).

    Each sample holds until the next one. Of samples on the periods' own grid it is the
    last one at or before that time; of others, of a faster log or one with jitter, the
    mean over the period: the last one would be too old by up to a period.
    """
    exact = on_grid(time, period)
    if exact is None:
        steps = np.diff(time, prepend=time[0])[:, None]
        areas = np.cumsum(steps * np.roll(command, 1, axis=0), axis=0)

        def area(end: Array) -> Array:
            """Return the integral of the command until some times [% s]."""
            index = np.searchsorted(time, end, side="right") - 1
            since = (end - time[index])[:, None]
            begun = index[:, None] >= 0
            return np.where(begun, areas[index] + since * command[index], 0.0)

        return (area(at + period) - area(at)) / period
    # a sample at the time itself counts, but for rounding
    index = np.searchsorted(exact, at + 1e-6 * period, side="right") - 1
    return np.where(index[:, None] >= 0, command[index], 0.0)
