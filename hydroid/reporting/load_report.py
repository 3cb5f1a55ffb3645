"""What each joint carries, what a load does to its speed, and whether its valve leaks."""

from collections.abc import Sequence

from hydroid.estimate import FitSummary
from hydroid.identified_model import IdentifiedModel
from hydroid.log import Log
from hydroid.posterior.posterior import stored_posterior
from hydroid.posterior.under_load import Known, MovedUnderLoad, UnderLoad, under_load
from hydroid.reporting.knowledge_report import quantity_source
from hydroid.reporting.page import Cell, Section, Table
from hydroid.reporting.stated_values import value_and_origin
from hydroid.settings.fit import FitSettings
from hydroid.words import interval_words, three_digits, value_words

_CARRIED = (
    "Each joint in the middle of its logged travel; the other joints stand where the first log "
    "starts. Gravity is what holds the joint, inertia that of all that moves with it. Given: it "
    "follows from the arm's file and fixed parameters."
)
_LOADED = (
    " Second table: the load is what holds the joint in this pose. The change is that of its speed "
    "from this load to twice the load, with a 95 % interval."
)
_LEAKS = (
    " Leakage lets a joint creep under its load while the valve is shut. The fit does not estimate "
    "a fixed leakage: hydroid suggest tests whether the logs show another one."
)
_CARRIED_HEADER = ("joint", "pose", "gravity", "along the travel", "inertia")
_LEAKAGE_HEADER = ("leakage of the valve", "speed with the valve shut")
_LOADED_HEADER = (
    "joint",
    "command [%]",
    "unit",
    "speed without load",
    "with the load",
    "with twice the load",
    "change [%]",
)


def load_section(model: IdentifiedModel, logs: Sequence[Log]) -> Section | None:
    """Return the folded section of what the joints of a fit carry.

    None where the fit has no covariance.
    """
    posterior = stored_posterior(model)
    summary = model.summary
    if posterior is None or summary is None:
        return None
    settings = model.settings
    joints = [under_load(settings, posterior, logs, j) for j in settings.outputs]
    has_valves = settings.stage == "hyd"
    carried = list[tuple[Cell, ...]]()
    loaded = list[tuple[Cell, ...]]()
    for one in joints:
        row = _carried_row(settings, summary, one)
        if has_valves:
            row += (leakage(settings, summary, one.joint), _creeps(settings, one))
        carried.append(row)
        loaded += [_loaded_row(settings, one, moved) for moved in one.moved]
    title = "Gravity and inertia"
    text = _CARRIED
    header = _CARRIED_HEADER
    if has_valves:
        title = "Load: gravity, inertia, load dependence of the speed, leakage"
        header += _LEAKAGE_HEADER
        text += _LOADED if loaded else ""
        text += _LEAKS
    tables = {"carried": Table("", header, tuple(carried))}
    if loaded:
        tables["loaded"] = Table("", _LOADED_HEADER, tuple(loaded))
    answer = _answer(settings, summary, joints)
    return Section(title, text, tables=tables, folded=True, answer=answer)


def leakage(settings: FitSettings, summary: FitSummary, joint: int) -> str:
    """Say how large the leakage of a joint's valve is, and whether it is known."""
    if not settings.rung.has("leakage"):
        return "none in this model"
    return value_and_origin(settings, summary, "leakage", joint)


def _answer(
    settings: FitSettings, summary: FitSummary, joints: Sequence[UnderLoad]
) -> str:
    """Say what twice the load does to the speeds, and of the leakage whether it is
    known."""
    slower = list[str]()
    leaks = dict[str, list[str]]()
    for one in joints:
        name = settings.arm.name_of(one.joint)
        changes = [
            f"{moved.word} {_percent(moved.change)}"
            for moved in one.moved
            if moved.change is not None
        ]
        if changes:
            slower.append(f"{name} {', '.join(changes)}")
        if settings.stage == "hyd":
            leaks.setdefault(leakage(settings, summary, one.joint), []).append(name)
    answers = list[str]()
    if slower:
        answers.append(f"speeds if the load of gravity doubles: {'; '.join(slower)}")
    for words, names in leaks.items():
        of = f" of {', '.join(names)}" if len(leaks) > 1 else ""
        answers.append(f"leakage{of}: {words}")
    return "; ".join(answers)


def _percent(change: Known) -> str:
    percent = round(change.value)
    return f"{percent:+d} %".replace("-", "−") if percent else "0 %"


def _carried_row(
    settings: FitSettings, summary: FitSummary, one: UnderLoad
) -> tuple[Cell, ...]:
    """Return what a joint carries, and where."""
    name = settings.arm.name_of(one.joint)
    slides = settings.arm.joint(one.joint).slides
    forces, masses = ("N", "kg") if slides else ("N·m", "kg·m²")
    low, high = map(three_digits, one.over_travel)
    stated = summary.quantities.get(f"{name}_gravity_torque_at_pose")
    source = quantity_source(stated) if stated else ""
    gravity = _known(one.gravity, forces, source)
    along = f"{low} to {high} {forces}"
    inertia = _known(one.inertia, masses)
    return name, one.pose, gravity, along, inertia


def _known(known: Known, unit: str, source: str = "") -> str:
    """Write a value with its unit, its interval and its source, or that it is given."""
    value = f"{value_words(known.value, *known.interval)} {unit}"
    if known.given:
        return f"{three_digits(known.value)} {unit} (given)"
    between = interval_words(*known.interval)
    return f"{value} ({'; '.join(filter(None, (between or 'not known', source)))})"


def _creeps(settings: FitSettings, one: UnderLoad) -> str:
    """Write the speed of a joint with its valve shut."""
    unit = settings.arm.joint(one.joint).shown.unit
    if one.shut is None or one.shut.value == 0.0:
        return f"0 {unit}/min"
    return f"{three_digits(60.0 * one.shut.value)} {unit}/min"


def _loaded_row(
    settings: FitSettings, one: UnderLoad, moved: MovedUnderLoad
) -> tuple[Cell, ...]:
    """Return the speeds of a joint in one direction under no load, its load and twice
    the load."""
    name = settings.arm.name_of(one.joint)
    unit = f"{settings.arm.joint(one.joint).shown.unit}/s"
    speeds = [value_words(known.value, *known.interval) for known in moved.speeds]
    change = "stands still"
    if moved.change is not None:
        between = interval_words(*moved.change.interval)
        change = value_words(moved.change.value, *moved.change.interval)
        change = f"{change} ({between or 'not known'})"
    return name, f"{moved.command:g} {moved.word}", unit, *speeds, change
