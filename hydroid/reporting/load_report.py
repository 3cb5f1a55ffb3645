"""What each joint carries, what a load does to its speed, and whether its valve leaks."""

from collections.abc import Sequence
from functools import partial

from hydroid.estimate import FitSummary
from hydroid.identified_model import IdentifiedModel
from hydroid.log import Log
from hydroid.posterior.posterior import stored_posterior
from hydroid.posterior.under_load import Known, MovedUnderLoad, UnderLoad, under_load
from hydroid.reporting.knowledge_report import quantity_source
from hydroid.reporting.page import Cell, Section, Table
from hydroid.reporting.stated_values import is_mostly_prior, value_and_origin
from hydroid.settings.fit import FitSettings
from hydroid.words import (
    interval_words,
    listed,
    three_digits,
    value_and_interval,
    value_words,
)

LEAST_CHANGE = 1.0
"""change of a speed under load that a heading names [%]"""

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
        title = "Load, inertia, friction, leakage"
        header += _LEAKAGE_HEADER
        text += _LOADED if loaded else ""
        text += _LEAKS + _without_friction(settings, summary)
    tables = {"carried": Table("", header, tuple(carried))}
    if loaded:
        tables["loaded"] = Table("", _LOADED_HEADER, tuple(loaded))
    answer = _answer(settings, summary, joints)
    return Section(title, text, tables=tables, folded=True, answer=answer)


def _without_friction(settings: FitSettings, summary: FitSummary) -> str:
    """Say which joints of a model with valves have no friction, and what makes up for it;
    nothing where all have some."""
    smooth: dict[bool, list[str]] = {True: [], False: []}
    for joint in settings.outputs:
        has = partial(_acts, settings, summary, joint)
        if not (has("dry_friction") or has("friction")):
            smooth[has("damping")].append(settings.arm.name_of(joint))
    said = ""
    for is_damped, names in smooth.items():
        if names:
            where = "the damping of the joint and " if is_damped else ""
            said += (
                f" The model of {listed(names)} has no friction: such losses are in "
                f"{where}the fitted opening of the valve."
            )
    return said


def _acts(
    settings: FitSettings, summary: FitSummary, joint: int, quantity: str
) -> bool:
    """Return whether a quantity of a joint has a value other than 0."""
    for name, parameter in settings.parameters.items():
        is_here = joint in (parameter.joints or (joint,))
        if is_here and parameter.quantity == quantity:
            return bool(summary.estimate[name].value)
    # dampers and friction of joints are parameters or none
    return bool(getattr(settings.hydraulics, quantity, 0.0))


def leakage(settings: FitSettings, summary: FitSummary, joint: int) -> str:
    """Say how large the leakage of a joint's valve is, and whether it is known."""
    if not settings.rung.has("leakage"):
        return "none in this model"
    return value_and_origin(settings, summary, "leakage", joint)


def _answer(
    settings: FitSettings, summary: FitSummary, joints: Sequence[UnderLoad]
) -> str:
    """Say what load the logs state, whether masses are known from them, and what twice
    the load does to the speeds."""
    slower = list[str]()
    for one in joints:
        changes = [moved.change for moved in one.moved if moved.change is not None]
        most = max(changes, key=lambda change: abs(change.value), default=None)
        if most and abs(most.value) >= LEAST_CHANGE:
            slower.append(f"{settings.arm.name_of(one.joint)} {_percent(most)}")
    answers = [_payload(settings), *_prior_masses(settings, summary)]
    if slower:
        answers.append(f"speed at twice the load: {', '.join(slower)}")
    return "; ".join(answers)


def _payload(settings: FitSettings) -> str:
    """Say which payloads the settings state of logs [kg]."""
    stated = [f"{kg:g}" for kg in dict.fromkeys(settings.payloads.values())]
    return f"payload: {listed(stated)} kg" if stated else "no payload stated"


def _prior_masses(settings: FitSettings, summary: FitSummary) -> list[str]:
    """Say which of the masses that a fit estimates are mostly the priors'."""
    free = [
        name
        for name, parameter in settings.parameters.items()
        if parameter.quantity == "mass" and parameter.fixed is None
    ]
    vague = [name for name in free if is_mostly_prior(summary.estimate[name])]
    if not vague:
        return []
    of = "" if len(vague) == len(free) else f" ({listed(vague)})"
    return [f"masses{of} mostly prior"]


def _percent(change: Known) -> str:
    sign = "+" if change.value > 0 else ""
    return f"{sign}{value_and_interval(change.value, *change.interval)} %"


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
