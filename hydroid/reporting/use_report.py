"""How to use a fit: the files of its run, units and signs, and the next commands."""

import shlex
from collections.abc import Iterator

from hydroid.findings import Finding
from hydroid.reporting.data_report import TITLE as DATA, VALIDITY
from hydroid.reporting.page import Cell, Section, Table
from hydroid.reporting.parameters_report import direction_word
from hydroid.run.record import FinishedRun
from hydroid.settings.arm import Joint
from hydroid.settings.log import LENGTHS, ColumnMap, log_file
from hydroid.words import listed, plain

TITLE = "How to use it"
NEEDED = ("estimate.yaml", "config.yaml", "arm.yaml", "model/")
"""files and folders of a run from which its model is loaded"""
_FILES = {
    "report.html": "this page",
    "estimate.yaml": "all results for programs: values, intervals, covariance, verdict, quantities, curves",
    "config.yaml, arm.yaml": "settings and arm of the fit",
    "tables/": "the tables of this page as CSV, with all digits",
    "result.npz": "logs, responses and bands: what this page is drawn from",
    "validations/": "the same of each unseen log",
    "history.csv, pareto.csv": "course and best candidates of the search",
    "run.json, run.log": "versions, seed and hashes; what the fit printed",
    "checkpoint.npz": "state of the search, for --resume",
}
_MODEL_FILES = {
    "mech": {
        "model/arm.xml": "the arm (MJCF) before the fit",
        "model/fitted.xml": "the fitted arm (MJCF): its motors take commands in %",
    },
    "hyd": {
        "model/arm.xml": "the arm (MJCF) before the fit",
        "model/mechanics.xml": "the fitted arm (MJCF) without its hydraulics",
        "model/actuators.yaml": "the fitted hydraulics by joint",
    },
}
_HEADER = (
    "joint",
    "command in files",
    "positive command",
    "angle in files",
    "range",
)
_NOTE = (
    "Files have the columns, units and signs of the fitted logs, and the time in the column "
    "{time}, in {unit}. Positive: as the model and Python have it, after the scale of this table. "
    "Python takes commands in %, and returns angles in rad, positions in m, pressures in Pa."
)


def use_section(run: FinishedRun) -> Section:
    """Return the folded section of what a run is good for, and how."""
    period = run.settings.log.period_s
    steps = tuple(_steps(run))
    # that of Python has no name of a command
    commands = [str(step.numbers["command"]).split()[1] for step in steps[:-1]]
    return Section(
        TITLE,
        points=(
            f"Sample time: {period:g} s. A command holds for one sample; files with other steps "
            "are resampled.",
            "Input limits: −100 to 100 %; what is beyond is cut. What the logs drove: "
            f"“{DATA}”; where the model holds: “{VALIDITY}”.",
            f"To load the model elsewhere, copy {listed(NEEDED)} of {run.folder}.",
        ),
        tables={"units": _unit_table(run), "files": _file_table(run)},
        steps=steps,
        folded=True,
        answer=f"files, units and signs, {listed(commands)}, Python",
    )


def _unit_table(run: FinishedRun) -> Table:
    """Return the table of the joints that take commands: columns, units, signs."""
    settings = run.settings
    time = settings.log.time
    joints = run.summary.joints or settings.outputs
    rows = tuple(_row(run, joint) for joint in joints)
    note = _NOTE.format(time=time.column, unit=time.unit)
    return Table("Units and signs", _HEADER, rows, note)


def _file_table(run: FinishedRun) -> Table:
    """Return the table of the files of a run."""
    files = _FILES | _MODEL_FILES[run.settings.stage]
    if not run.validations:
        del files["validations/"]
    header = ("file", "what it holds")
    return Table(f"Files in {run.folder}", header, tuple(files.items()))


def _row(run: FinishedRun, joint: int) -> tuple[Cell, ...]:
    """Return how a joint is written in files, and what its commands do."""
    settings = run.settings
    one = settings.arm.joint(joint)
    command = settings.log.columns("command", joint)
    angle = settings.log.columns("angle", joint)
    unit = one.shown.setting
    ends = "no ends"
    if not one.continuous:
        low, high = (plain(float(f"{end:.4g}")) for end in one.range)
        ends = f"{low} to {high} {unit}"
    return (
        one.name,
        _column(command, "command"),
        positive_command(run, joint),
        _column(angle, _measured(one, angle)),
        ends,
    )


def _column(columns: ColumnMap | None, what: str) -> str:
    """Write the columns of a quantity, and how their cells become it."""
    if columns is None:
        return "none"
    names = " / ".join(columns.column)
    if (columns.scale, columns.offset) == (1.0, 0.0):
        return f"{names}: {what} in {columns.unit}"
    sign = "−" if columns.offset < 0 else "+"
    offset = f" {sign} {plain(abs(columns.offset))}" if columns.offset else ""
    scale = plain(columns.scale)
    return f"{names}: {what} [{columns.unit}] = {scale} · cell{offset}"


def _measured(joint: Joint, angle: ColumnMap | None) -> str:
    """Say what the column of a joint's angle holds."""
    is_length = angle is not None and angle.unit in LENGTHS
    if is_length and not joint.slides:
        return "length of the cylinder"
    return joint.shown.word


def positive_command(run: FinishedRun, joint: int) -> str:
    """Say what a positive command does to a joint: to its weight, and to its angle, by
    the speeds of the fit.

    Empty where the fit does not know the speeds.
    """
    settings = run.settings
    name = settings.arm.name_of(joint)
    curve = run.summary.curves.get(f"{name}_speed")
    if curve is None:
        return ""
    at, speed = max(zip(curve.at, curve.value, strict=True))
    if at <= 0 or speed == 0:
        return ""
    word = settings.arm.joint(joint).shown.word
    turns = f"{word} {'rises' if speed > 0 else 'falls'}"
    moves = direction_word(run.summary, name, "positive")
    return ", ".join(filter(None, (moves, turns)))


def _steps(run: FinishedRun) -> Iterator[Finding]:
    """Yield what to do with a run, each with a command that can be pasted."""
    folder = shlex.quote(run.folder)
    log = _example(run)
    file = shlex.quote(log)
    yield _step(
        "use: simulate", f"hydroid simulate {file} --fit {folder} --out played.csv"
    )
    if run.settings.stage == "hyd":
        yield _step(
            "use: follow",
            f"hydroid follow TRAJECTORY.csv --fit {folder} --out commands.csv",
        )
    yield _step("use: export", f"hydroid export {folder} --to mjcf --out export")
    name = run.settings.arm.name_of(run.settings.outputs[0])
    lines = (
        "import hydroid",
        f"predicted = hydroid.simulate({log!r}, fit={run.folder!r}).log",
        "predicted.time, predicted.angle  # [s], [rad]",
        f"plant = hydroid.load_plant({run.folder!r})",
        f"angle = plant.step({{{name!r}: 50}})  # of all joints, one sample later [rad]",
    )
    yield _step("use: python", "\n".join(lines))


def _step(kind: str, command: str) -> Finding:
    return Finding(kind, "note", (), {"command": command})


def _example(run: FinishedRun) -> str:
    """Return a log that the commands can be tried on: an unseen one, if there is one; of
    a file that gaps split, a name to be replaced."""
    predictions = [*run.validations.values(), *run.result.fitted]
    for prediction in predictions:
        source = prediction.log.source
        if str(log_file(source)) == source:
            return source
    return "COMMANDS.csv"
