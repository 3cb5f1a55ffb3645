"""What a fit was made from and judged by: its logs, fitted and unseen."""

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from hydroid.arrays import Array, record
from hydroid.fitting.validation import Prediction
from hydroid.log import Log
from hydroid.log.command_sizes import HELD, largest_commands
from hydroid.log.conditions import stated, words_of
from hydroid.log.log import LEAST_COMMAND
from hydroid.reporting.page import Cell, Given, Section, Table, log_names
from hydroid.run.record import FinishedRun
from hydroid.settings.fit import FitSettings
from hydroid.settings.log import EFFECTS, log_file
from hydroid.words import listed, three_digits, two_digits

TITLE = "Data"
VALIDITY = "Range of validity"
"""how the title begins of the section that has commands by joint, and what logs lack"""
NO_BREAK = "\u00a0"
"""blank at which no line ends"""
EVEN = 0.02
"""part of the usual step by which others may differ from it and are even"""
MOVES = 0.02
"""part of its travel that a joint covers in a second at least while it moves"""
HALF_WINDOW = 0.1
"""to each side of a moment, over which its speed counts [s]"""
STANDS = 0.2
"""motion of a joint up to which it stands [deg, mm]"""
MOSTLY = 5.0
"""percent of the driven time that the stated range of commands leaves out below it"""
NOTABLE = 0.005
"""part of the time that is worth a word"""
LEAST_GAP = 5.0
"""command from which nothing below it was driven is worth a word [%]"""
_TEXT = (
    "Logs as their files have them; the fit resamples all to {period:g} s ({rate:.3g} Hz). Under "
    "each joint: how far it moves and, in brackets, its largest negative and positive command "
    f"that lasts {HELD:g} s in all."
)
_NOT_STORED = (
    "The rows, rates and gaps of the files are not stored of {names}, which an earlier version read. "
    "Samples are counted after resampling there."
)


@record
class Together:
    """Parts of the time of logs in which so many joints move at once."""

    none: float
    one: float
    several: float


def data_section(run: FinishedRun) -> Section:
    """Return the folded section of the logs of a run."""
    settings = run.settings
    fitted = [prediction.log for prediction in run.result.fitted]
    unseen = [*run.validations.values()]
    logs = [*fitted, *(prediction.log for prediction in unseen)]
    joints = _joints(settings, logs)
    uses = ["fitted"] * len(fitted) + [_use(one) for one in unseen]
    period = settings.log.period_s
    return Section(
        TITLE,
        _TEXT.format(period=period, rate=1.0 / period),
        points=tuple(_points(settings, fitted, logs)),
        tables={"logs": _log_table(settings, logs, uses, joints)},
        folded=True,
        answer=_answer(settings, fitted, logs[len(fitted) :]),
    )


def _use(prediction: Prediction) -> str:
    """Say what a log that was not fitted is for."""
    return "unseen, apart from the verdict" if prediction.apart else "unseen"


def _joints(settings: FitSettings, logs: Sequence[Log]) -> list[int]:
    """Return the joints, from 1, that are compared or that any log drives."""
    # a joint that no angle of is compared still takes oil from the pump
    driven = np.any([log.driven for log in logs], axis=0)
    also = (1 + np.flatnonzero(driven)).tolist()
    return sorted({*settings.outputs, *also})


def _log_table(
    settings: FitSettings, logs: Sequence[Log], uses: Sequence[str], joints: list[int]
) -> Table:
    """Return the table of logs, one row each."""
    names = log_names(log.source for log in logs)
    columns = ["log", "use", "length [s]", "samples"]
    # runs of before did not store what the files held
    has_rates = any(log.rows for log in logs)
    if has_rates:
        columns.append("rate [Hz]")
    if settings.payloads:
        columns.append("load [kg]")
    for joint in joints:
        unit = settings.arm.joint(joint).shown.unit
        columns.append(f"{settings.arm.name_of(joint)} [{unit}]")
    rows = list[tuple[Cell, ...]]()
    for log, use in zip(logs, uses, strict=True):
        samples = log.rows.count if log.rows else len(log.time)
        row: list[Cell] = [
            names[log.source],
            use,
            Given(round(log.duration, 1)),
            samples,
        ]
        if has_rates:
            row.append(_rate(log))
        if settings.payloads:
            row.append(f"{settings.payload_of(log.source):g}")
        row += [_motion(settings, log, joint) for joint in joints]
        rows.append(tuple(row))
    return Table("", tuple(columns), tuple(rows), _not_stored(logs))


def _not_stored(logs: Sequence[Log]) -> str:
    """Say of which logs a run does not store what their files held; nothing of none."""
    names = [Path(log.source).name for log in logs if log.rows is None]
    if not names:
        return ""
    return _NOT_STORED.format(
        names="these logs" if len(names) == len(logs) else listed(names, 4)
    )


def _rate(log: Log) -> str:
    """Write how often a file has a row, and how much its steps differ; nothing where
    that is not stored."""
    if log.rows is None:
        return ""
    shortest, usual, longest = log.rows.steps
    # a clock that errs by so little has no range that anybody asks for
    rate = three_digits(1.0 / usual)
    if max(longest - usual, usual - shortest) <= EVEN * usual:
        return f"{rate}, even"
    return f"{rate}, steps {three_digits(1e3 * shortest)} to {three_digits(1e3 * longest)} ms"


def _motion(settings: FitSettings, log: Log, joint: int) -> str:
    """Write how far a joint moves in a log, and its largest commands."""
    shown = settings.arm.joint(joint).shown
    moved = "not measured"
    if log.measures(joint):
        travel = shown.factor * float(np.ptp(log.angle_of(joint)))
        moved = two_digits(travel)
        # that nobody drives it either goes without saying
        if travel < STANDS and not log.drives(joint):
            return "stands"
    if not log.drives(joint):
        return f"{moved} (no command)"
    low, high = largest_commands([log], joint)
    # one word to a browser: a phone shows a line a row
    commands = f"({_signed(low)} to {_signed(high)} %)".replace(" ", NO_BREAK)
    return f"{moved} {commands}"


def _signed(value: float) -> str:
    return f"{value:+.0f}".replace("+0", "0").replace("-0", "0")


def _points(
    settings: FitSettings, fitted: Sequence[Log], logs: Sequence[Log]
) -> Iterator[str]:
    """Yield what the table does not show."""
    if len(settings.outputs) > 1:
        shares = moving_together(settings, fitted)
        said = (
            "Joints together: in the fitted logs, two or more joints move at once in "
            f"{_part(shares.several)} of the time"
        )
        for share, what in ((shares.one, "one alone"), (shares.none, "none")):
            if share >= NOTABLE:
                said += f", {what} in {_part(share)}"
        yield f"{said}."
    if said := _sizes(settings, fitted):
        yield said
    yield from _left_out(logs)
    yield from _pressures(settings, logs)
    yield from _conditions(settings, logs)


def moving_together(settings: FitSettings, logs: Sequence[Log]) -> Together:
    """Return in which parts of the time of logs no, one and several of the compared
    joints move.

    A command is no sign of it: a controller gives some inside the dead bands, too.
    """
    travel = dict[int, float]()
    for joint in settings.outputs:
        angles = [log.angle_of(joint) for log in logs if log.measures(joint)]
        travel[joint] = max((float(np.ptp(angle)) for angle in angles), default=0.0)
    seconds = np.zeros(3)
    for log in logs:
        counts = np.zeros(len(log.time), dtype=np.int64)
        for joint in settings.outputs:
            if log.measures(joint):
                counts += _speeds(log, joint) > MOVES * travel[joint]
        # two joints or ten: each may slow the others
        of_log = np.bincount(counts.clip(max=2), minlength=3)
        seconds += log.period * of_log
    none, one, several = (seconds / seconds.sum()).tolist()
    return Together(none, one, several)


def _speeds(log: Log, joint: int) -> Array:
    """Speed of a joint (number, from 1) without its sign, shape (T,) [rad/s, m/s]."""
    angle = log.angle_of(joint)
    half = max(round(HALF_WINDOW / log.period), 1)
    at = np.arange(len(angle))
    # at the ends of a log the window is shorter
    before = np.maximum(at - half, 0)
    after = np.minimum(at + half, len(angle) - 1)
    return np.abs(angle[after] - angle[before]) / ((after - before) * log.period)


def _part(share: float) -> str:
    """Write a part of the time."""
    percent = round(100 * share)
    return {0: "no part", 100: "all"}.get(percent, f"{percent} %")


def _sizes(settings: FitSettings, logs: Sequence[Log]) -> str:
    """Say which sizes the commands of the compared joints have while they are driven."""
    columns = [joint - 1 for joint in settings.outputs]
    sizes = np.concatenate([np.abs(log.command[:, columns]).ravel() for log in logs])
    sizes = sizes[sizes >= LEAST_COMMAND]
    if not len(sizes):
        return ""
    smallest, usual, largest = np.percentile(sizes, [0.0, MOSTLY, 100.0])
    said = (
        f"Size of the commands: up to {largest:.0f} %, and {usual:.0f} % or more in "
        f"{100 - MOSTLY:.0f} % of the driven time"
    )
    if smallest >= LEAST_GAP:
        said += f"; nothing between −{smallest:.0f} and +{smallest:.0f} %"
    return f"{said}. By joint: “{VALIDITY}”."


def _left_out(logs: Sequence[Log]) -> Iterator[str]:
    """Yield what was left out, filled or split in each file, and where."""
    files = dict[str, tuple[str, ...]]()
    for log in logs:
        if log.rows is not None:
            # parts between gaps are of one file
            files[str(log_file(log.source))] = log.rows.left_out
    faulty = {file: left_out for file, left_out in files.items() if left_out}
    if files and not faulty:
        yield "Left out: nothing. No log has a gap, or a row without numbers."
    for file, left_out in faulty.items():
        yield f"Left out or filled in {Path(file).name}: {'; '.join(left_out)}."


def _pressures(settings: FitSettings, logs: Sequence[Log]) -> Iterator[str]:
    """Yield the joints whose chamber pressures the logs measure."""
    for joint in settings.outputs:
        measured = [
            log.pressure[:, joint - 1] for log in logs if log.pressure is not None
        ]
        measured = [one for one in measured if np.isfinite(one).any()]
        if not measured:
            continue
        low = 1e-5 * min(np.nanmin(one) for one in measured)
        high = 1e-5 * max(np.nanmax(one) for one in measured)
        name = settings.arm.name_of(joint)
        yield (
            f"Pressures of the {name}: measured in {len(measured)} of {len(logs)} logs, "
            f"{low:.0f} to {high:.0f} bar."
        )


def _conditions(settings: FitSettings, logs: Sequence[Log]) -> Iterator[str]:
    """Yield between which values the engine's speed and the oil's temperature were."""
    for name in EFFECTS:
        column = settings.log.condition(name)
        values = [stated(log, settings.log, name) for log in logs]
        held = [one for one in values if one is not None]
        if column is not None and held:
            low = three_digits(min(float(one.min()) for one in held))
            high = three_digits(max(float(one.max()) for one in held))
            yield f"{words_of(name).capitalize()}: {low} to {high} {column.unit}."


def _answer(settings: FitSettings, fitted: Sequence[Log], unseen: Sequence[Log]) -> str:
    """Say how much data there is, and how often joints move together."""
    said = f"{_counted(fitted)} fitted, {_counted(unseen)} unseen"
    if len(settings.outputs) > 1:
        several = moving_together(settings, fitted).several
        said += f"; two or more joints move at once in {_part(several)} of the time"
    if any(log.rows and log.rows.left_out for log in (*fitted, *unseen)):
        said += "; some rows left out"
    return said


def _counted(logs: Sequence[Log]) -> str:
    """Write how many logs these are, and how long all together."""
    if not logs:
        return "no log"
    seconds = sum(log.duration for log in logs)
    return f"{len(logs)} log{'s' if len(logs) > 1 else ''} ({seconds:.0f} s)"
