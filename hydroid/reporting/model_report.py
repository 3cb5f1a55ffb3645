"""What the model of a fit contains: which effects of a machine are in it, which were
tried and dropped, and which it lacks."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

from hydroid.estimate import FitSummary
from hydroid.fitting.left_out import is_clear
from hydroid.fitting.step import step_of
from hydroid.quantity_table import CHOICES, HYDRAULIC, TARGETS
from hydroid.reporting.page import Section, Table
from hydroid.run.record import FinishedRun
from hydroid.rungs import BY_COMMAND, GAIN, RUNGS
from hydroid.settings.fit import FitSettings
from hydroid.settings.problem import ParameterSettings
from hydroid.words import listed, plain, two_digits

TITLE = "What the model contains"
PARAMETERS = "Parameters"
"""how the title begins of the section that has the values"""
State = Literal["estimated", "held", "off"]
ESTIMATED: State = "estimated"
HELD: State = "held"
OFF: State = "off"
IN = "in the model"
REJECTED = "tested and rejected"
OUT = "not in the model"
_TEXT = (
    "Values of what is estimated or held: “{parameters}”. hydroid suggest tests whether the logs "
    "ask for what the settings switch off or hold."
)
_GAIN = (
    " Gain: rise of the log-likelihood of parts of the logs that were left out, ± its standard "
    "error. An effect is kept if the rise exceeds 3, and 1.64 standard errors."
)
_TABLES = {
    IN: ("in_the_model", "In the model", "how"),
    REJECTED: ("tested_and_rejected", "Tested and rejected", "what it gained"),
    OUT: ("not_in_the_model", "Not in the model", "why, and what stands for it"),
}
"""file, title and second column of the table of each state"""
Gain = tuple[float | None, float | None] | None
"""what a term gained and the standard error; None: it was not refined"""


class Effect(NamedTuple):
    """An effect of a machine, in plain words.

    Attributes:
        name: of the effect.
        decides: quantities, any of which brings it into the model.
        shapes: quantities that say more of it once it is there.
        instead: what the model does without it.
    """

    name: str
    decides: tuple[str, ...]
    shapes: tuple[str, ...] = ()
    instead: str = ""


FRICTION = Effect(
    "dry friction of joints and seals",
    ("friction", "dry_friction"),
    instead="all losses grow with the speed",
)
OIL = Effect(
    "compressible oil",
    ("bulk_modulus", "oil_frequency"),
    ("dead_volume", "line_volume", "oil_damping", "oil_damping_share"),
    instead="the oil is stiff, so no joint rings on it",
)
PUMP = Effect(
    "limit of the pump's flow (saturation)",
    ("pump_flow",),
    instead="the pump gives any flow",
)
COMMAND_ALONE = Effect(
    "speed by the command alone",
    (BY_COMMAND,),
    instead="load and pump act on the speed of every joint",
)
STOPS = Effect("end stops of the joints", ("stop_penetration",))
HYDRAULICS = "hydraulics: delay, dead band, valves, leakage, compressible oil, pump"
"""what stage 1 has none of, in one row"""
EFFECTS = (
    Effect("torque in proportion to the command", ("gain",)),
    Effect("weight of the links (gravity)", ("mass",)),
    Effect("viscous damping of the joints", ("damping",)),
    FRICTION,
    Effect("springs at the joints", ("stiffness",)),
    Effect("transport delay of the commands", ("delay",)),
    Effect("dead band of the valves", ("dead_band", "overlap")),
    Effect("jump of a valve at the smallest command", ("onset",)),
    Effect("lag of the pilot stage", ("pilot_lag",)),
    Effect(
        "solenoid and spool: force, spring, lag",
        ("plunger_damping", "plunger_stiffness"),
        (
            "plunger_mass",
            "current_max",
            "current_min",
            "force_1",
            "force_2",
            "stroke_1",
            "stroke_2",
            "rated_current",
            "slot_width",
        ),
    ),
    Effect("lag of the valve's opening", ("opening_lag",), ("lag_of_speed",)),
    Effect(
        "flow by the valve's opening and the pressure drop",
        ("opening",),
        ("opening_exponent", "flow_coefficient", "transition_pressure"),
    ),
    Effect(
        "bends in the valve's curve",
        ("curve_1", "curve_2", "curve_3", "curve_4"),
        instead="the opening grows by a power of the command",
    ),
    Effect(
        "return edge unlike the pump edge",
        ("return",),
        instead="both edges of a valve open alike",
    ),
    Effect(
        "load compensation of the valves",
        ("compensation",),
        instead="a load slows a joint by its full pressure",
    ),
    Effect("limit of the flow to one actuator", ("flow_limit",)),
    Effect(
        "regeneration, and loads that lower themselves",
        ("draw",),
        instead="the pump gives all that a chamber takes",
    ),
    COMMAND_ALONE,
    Effect("leakage of the valves", ("leakage",)),
    Effect("anti-cavitation valves", ("anticavitation",)),
    Effect(
        "pins and levers of the cylinders",
        ("pivot_distance_1", "pivot_distance_2", "pivot_angle"),
        ("area",),
    ),
    Effect(
        "lever of an unknown linkage, over the travel", ("lever_slope", "lever_bend")
    ),
    OIL,
    PUMP,
    Effect(
        "supply pressure that falls with the flow",
        ("pump_droop",),
        ("pump_exponent", "pump_limit"),
    ),
    Effect("open centre of the valves", ("pump_bypass",)),
    Effect("pump that comes up late", ("pump_idle", "pump_delay", "pump_rise")),
    Effect("supply and tank pressure", ("supply_pressure", "tank_pressure")),
    Effect(
        "chamber pressures at the start",
        ("start_pressure", "trapped_pressure"),
    ),
    STOPS,
    Effect("engine speed", ("engine_exponent",), instead="as in the fitted logs"),
    Effect(
        "temperature of the oil",
        ("temperature_effect",),
        instead="as in the fitted logs",
    ),
    Effect("errors of the angle's sensor: scale, lag", ("sensor_scale", "sensor_lag")),
)
"""effects that quantities stand for: each quantity is of one of them"""
SHARED = "joints coupled by the shared pump"
NEVER = (
    "backlash (play) of pins and gears",
    "hysteresis and sticking of valves",
    "relief valves at the actuators",
    "bending of links and hoses",
    "contact, such as a bucket that digs",
)
"""effects that no model of hydroid has"""


@dataclass(frozen=True)
class Contained:
    """An effect in a fit: its state, a key of _TABLES, and how it is in the model, or why
    not."""

    name: str
    state: str
    how: str


@dataclass(frozen=True)
class _Of:
    """What a fit has of an effect at one joint (its number from 1; 0: the pump's, which
    all share), and the value at which it is held."""

    joint: int
    state: State
    value: float | None = None


@dataclass(frozen=True)
class _Trial:
    """A term that was dropped: its quantities, each side by itself, the name of its
    joint if it is of one, and what it gained in words."""

    sides: frozenset[str]
    joint: list[str]
    gained: str


def model_section(run: FinishedRun) -> Section:
    """Return the folded section of the effects that the model of a run contains."""
    effects = contained(run)
    tables = dict[str, Table]()
    for state, (file, title, column) in _TABLES.items():
        rows = tuple((one.name, one.how) for one in effects if one.state == state)
        if rows:
            tables[file] = Table(title, ("effect", column), rows)
    text = _TEXT.format(parameters=PARAMETERS)
    if any(one.state == REJECTED or REJECTED in one.how for one in effects):
        text += _GAIN
    return Section(
        TITLE,
        text,
        tables=tables,
        folded=True,
        answer=_answer(run.settings, effects),
    )


def contained(run: FinishedRun) -> list[Contained]:
    """Return what the final model of a run has of every effect."""
    settings = run.settings
    trials = _dropped(run)
    stated = [
        _stated(settings, effect, trials)
        for effect in EFFECTS
        if _is_of(settings, effect)
    ]
    # stage 1 has one gain in place of twenty effects: one row says so
    if settings.stage == "mech":
        stated = [*_without_hydraulics(stated)]
    general = [*_motion(run), *_coupling(settings, stated)]
    never = [Contained(name, OUT, "in no model of hydroid") for name in NEVER]
    return [*stated, *general, *never]


def _is_of(settings: FitSettings, effect: Effect) -> bool:
    """Return whether an effect can be in a fit of this stage, and these joints."""
    # the gain is all that stage 1 has of the hydraulics, and stage 2 has none
    if effect.decides == ("gain",):
        return settings.stage == "mech"
    every = settings.outputs
    joints = map(settings.arm.joint, every)
    return any(joint.has(one) for joint in joints for one in effect.decides)


def _stated(
    settings: FitSettings, effect: Effect, trials: Sequence[_Trial]
) -> Contained:
    """Return what a fit has of an effect that quantities stand for."""
    if effect.decides == ("mass",):
        return Contained(effect.name, IN, _masses(settings))
    if effect is STOPS:
        how = "rigid" if settings.rung.at_once else "stiff"
        return Contained(effect.name, IN, f"{how}, at the ends of each joint's range")
    if effect is COMMAND_ALONE:
        return _command_alone(settings, trials)
    places = [*_places(settings, effect)]
    tested = _tested(settings, effect, trials)
    if all(place.state == OFF for place in places):
        if tested:
            return Contained(effect.name, REJECTED, tested)
        return Contained(effect.name, OUT, _why_not(settings, effect))
    ways = [*_ways(settings, effect, places)]
    if tested:
        ways.append(f"{REJECTED}: {tested}")
    return Contained(effect.name, IN, "; ".join(ways))


def _command_alone(settings: FitSettings, trials: Sequence[_Trial]) -> Contained:
    """Return which joints follow their commands alone, and what that gained where it was
    tried in vain."""
    name = COMMAND_ALONE.name
    tested = _tested(settings, COMMAND_ALONE, trials)
    joints = _by_command(settings)
    if joints:
        how = f"{listed(joints)}: load and pump do not predict it better"
        return Contained(name, IN, f"{how}; {REJECTED}: {tested}" if tested else how)
    if tested:
        return Contained(name, REJECTED, tested)
    return Contained(name, OUT, COMMAND_ALONE.instead)


def _by_command(settings: FitSettings) -> list[str]:
    """Return the names of the compared joints whose speed follows the command alone."""
    outputs = settings.outputs
    return [settings.arm.name_of(j) for j in outputs if settings.is_by_command(j)]


def _tested(settings: FitSettings, effect: Effect, trials: Sequence[_Trial]) -> str:
    """Say what the trials of an effect gained, where the final model could have it."""
    sides = _sides(effect).keys() - settings.rung.lacks
    joints = dict[str, list[str]]()
    for trial in trials:
        if not sides.isdisjoint(trial.sides):
            joints.setdefault(trial.gained, []).extend(trial.joint)
    told = [
        f"{listed(names)}: {gained}" if names else gained
        for gained, names in joints.items()
    ]
    return "; ".join(told)


def _places(settings: FitSettings, effect: Effect) -> Iterator[_Of]:
    """Yield what a fit has of an effect at each compared joint that can have it."""
    if all(CHOICES[one].of_the_pump for one in effect.decides):
        yield _best(settings, effect, 0)
        return
    for joint in settings.outputs:
        if any(map(settings.arm.joint(joint).has, effect.decides)):
            yield _best(settings, effect, joint)


def _best(settings: FitSettings, effect: Effect, joint: int) -> _Of:
    """Return what a fit has of an effect at a joint: estimated before held before
    off."""
    of_joint = [
        _of(settings, side, joint)
        for quantity in effect.decides
        for side in TARGETS[quantity]
        if not joint or settings.arm.joint(joint).has(quantity)
    ]
    # one side that is estimated is enough: the effect is in the model
    for state in (ESTIMATED, HELD):
        for one in of_joint:
            if one.state == state:
                return one
    return _Of(joint, OFF)


def _of(settings: FitSettings, side: str, joint: int) -> _Of:
    """Return what a fit has of a quantity, or one of its two sides, at a joint."""
    if side in settings.rung.lacks or settings.ignores(side, joint):
        return _Of(joint, OFF)
    # a parameter goes before the settings, and these before what is usual
    value = CHOICES[side].default
    if side in HYDRAULIC:
        value = getattr(settings.hydraulics, side)
    for parameter in _setting(settings, side):
        if joint and parameter.joints and joint not in parameter.joints:
            continue
        if parameter.fixed is None:
            return _Of(joint, ESTIMATED)
        value = parameter.fixed
    if _does_nothing(side, value):
        return _Of(joint, OFF)
    # what the arm's file says differs from joint to joint
    known = value if side in HYDRAULIC or _setting(settings, side) else None
    return _Of(joint, HELD, known)  # pyright: ignore[reportArgumentType]


def _does_nothing(side: str, value: object) -> bool:
    """Return whether a value of a quantity leaves its effect out: none, zero, or a factor
    of 1."""
    is_factor = not CHOICES[side].unit
    return value is None or value == 0.0 or (is_factor and value == 1.0)


def _setting(settings: FitSettings, side: str) -> list[ParameterSettings]:
    """Return the parameters of a quantity, or of one of its sides, without effects of
    groups of logs, which add to it."""
    return [
        parameter
        for parameter in settings.parameters.values()
        if parameter.per is None and side in TARGETS[parameter.quantity]
    ]


def _ways(
    settings: FitSettings, effect: Effect, places: Sequence[_Of]
) -> Iterator[str]:
    """Yield at which joints an effect is estimated, held at which value, or off."""
    # the pump is no joint's, so no joint needs a name
    everywhere = len(places) == len(settings.outputs) or not places[0].joint
    for state in (ESTIMATED, HELD, OFF):
        there = [place for place in places if place.state == state]
        if not there:
            continue
        words = str(state)
        if state == HELD:
            words += _value(effect, there)
        if not everywhere or len(there) < len(places):
            words += f": {listed([settings.arm.name_of(one.joint) for one in there])}"
        yield words
    changes = _changes(settings, effect)
    if changes:
        yield f"differs between groups of logs: {listed(changes, 3)}"


def _changes(settings: FitSettings, effect: Effect) -> list[str]:
    """Return the names of parameters by which an effect differs between groups of
    logs."""
    sides = _sides(effect).keys()
    return [
        name
        for name, parameter in settings.parameters.items()
        if parameter.per and not sides.isdisjoint(TARGETS[parameter.quantity])
    ]


def _sides(effect: Effect) -> dict[str, None]:
    """Return the quantities that decide on an effect, each side by itself, in order."""
    return dict.fromkeys(side for one in effect.decides for side in TARGETS[one])


def _value(effect: Effect, places: Sequence[_Of]) -> str:
    """Write the value at which an effect of a single quantity is held; nothing where it
    has several."""
    # joints that differ have their values in the table of parameters
    value = places[0].value
    is_shared = all(place.value == value for place in places)
    if value is None or not is_shared or effect.decides[1:]:
        return ""
    unit = CHOICES[effect.decides[0]].unit
    return f" at {plain(value)} {unit}".rstrip()


def _why_not(settings: FitSettings, effect: Effect) -> str:
    """Say why an effect is not in the model: the rung lacks it, or it is off."""
    why = "switched off in the settings"
    if not any(map(settings.rung.has, effect.decides)):
        others = [
            rung.name
            for rung in RUNGS.values()
            if rung.stage == settings.stage and any(map(rung.has, effect.decides))
        ]
        why = f"the {settings.rung.name} model leaves it out"
        if others:
            why += f"; the {listed(others)} one has it (simulation.model)"
    return "; ".join(filter(None, (effect.instead, why)))


def _masses(settings: FitSettings) -> str:
    """Say of which links a fit estimates the mass."""
    free = [
        parameter.link or "all links"
        for parameter in settings.parameters.values()
        if parameter.quantity == "mass" and parameter.fixed is None
    ]
    if not free:
        return "masses held"
    rest = "" if len(free) >= len(settings.arm.link_names) else "; other masses held"
    return f"masses estimated: {listed(free)}{rest}"


def _without_hydraulics(stated: Sequence[Contained]) -> Iterator[Contained]:
    """Yield the effects of a fit of stage 1, those of hydraulics as one."""
    possible = {effect.name for effect in EFFECTS if any(map(GAIN.has, effect.decides))}
    possible.add(STOPS.name)
    for one in stated:
        if one.name in possible:
            yield one
    why = "one gain stands for all of them; hydroid fit-hyd fits them"
    yield Contained(HYDRAULICS, OUT, why)


def _motion(run: FinishedRun) -> Iterator[Contained]:
    """Yield whether the links have inertia, and what a richer model gained that was not
    kept."""
    settings = run.settings
    name = "inertia of the links"
    if not settings.rung.at_once:
        yield Contained(name, IN, "from the masses and shapes of the links")
        return
    others = [
        rung.name
        for rung in RUNGS.values()
        if rung.stage == settings.stage and not rung.at_once
    ]
    for other in others:
        tried = [
            estimate
            for estimate in run.summary.estimates
            if step_of(estimate).model == other
        ]
        if tried:
            gained = run.summary.estimates[tried[-1]].gained
            yield Contained(
                name, REJECTED, f"the {other} model has it: {gain_words(gained)}"
            )
            return
    why = "speeds follow valve and load at once"
    yield Contained(
        name, OUT, f"{why}; the {listed(others)} model has it (simulation.model)"
    )


def _coupling(
    settings: FitSettings, stated: Sequence[Contained]
) -> Iterator[Contained]:
    """Yield how the joints act on each other."""
    if len(settings.arm.joints) < 2:
        return
    by_name = {one.name: one for one in stated}
    pump = by_name.get(PUMP.name)
    if settings.stage == "hyd" and len(settings.outputs) > 1:
        if pump is not None and pump.state == IN:
            how = "what one joint takes, the others lack"
            if unmoved := _by_command(settings):
                how += f"; it does not slow {listed(unmoved)}"
            yield Contained(SHARED, IN, how)
        else:
            yield Contained(SHARED, OUT, "every joint has the full supply pressure")
    how = "weight changes with the pose of all joints"
    if settings.rung.at_once:
        how += "; no joint accelerates another"
    else:
        how += ", and joints accelerate each other"
    if settings.simulation.other_joints == "locked":
        how += "; joints without commands are locked"
    yield Contained("joints coupled by the arm's weight and motion", IN, how)


def _dropped(run: FinishedRun) -> list[_Trial]:
    """Return the trials of the terms that the final model does not have."""
    # the settings of the final model no longer have the terms that it dropped
    begun = run.begun or run.settings
    kept = step_of(run.summary.final or "").terms
    every = (*begun.terms(), *begun.by_command_terms)
    return [_trial(run, begun, term) for term in every if term not in kept]


def _trial(run: FinishedRun, begun: FitSettings, term: str) -> _Trial:
    """Return the trial of a term of the settings that a fit has begun with."""
    own = [one for one in begun.parameters.values() if one.term == term]
    joints = {joint for one in own for joint in one.joints or ()}
    return _Trial(
        sides=frozenset(side for one in own for side in TARGETS[one.quantity]),
        joint=[begun.arm.name_of(*joints)] if len(joints) == 1 else [],
        gained=_trial_words(run.summary, term),
    )


def _trial_words(summary: FitSummary, term: str) -> str:
    """Say what a term gained that was dropped."""
    gained: Gain = None
    was_tried = False
    for name, estimate in summary.estimates.items():
        terms = step_of(name).terms
        # an estimate gained what its last term did
        if terms and terms[-1] == term:
            gained, was_tried = estimate.gained, True
    if term in summary.tried:
        gained, was_tried = summary.tried[term], True
        if gained is None:
            return "not fitted: it promised too little, or only noise was left"
    if not was_tried:
        return "not kept; what it gained is not stored"
    return gain_words(gained)


def gain_words(gained: Gain) -> str:
    """Write by how much more likely a model makes parts of the logs that it did not
    use."""
    rise, error = gained or (None, None)
    if rise is None or error is None:
        return "what it gained is not known"
    words = f"{two_digits(rise)} ± {two_digits(error)}"
    # what is clear on a joint alone may yet not be kept beside the others
    return f"gain {words}" if is_clear(rise, error) else f"gain {words}, not clear"


def _answer(settings: FitSettings, effects: Sequence[Contained]) -> str:
    """Answer what is asked first: friction, oil, pump, coupling."""
    by_name = {one.name: one for one in effects}

    def said(effect: Effect) -> str:
        one = by_name.get(effect.name)
        if one is None or one.state != IN:
            return "no"
        joints = [place for place in _places(settings, effect) if place.state != OFF]
        if len(joints) == len(settings.outputs) or not joints[0].joint:
            return "yes"
        return listed([settings.arm.name_of(place.joint) for place in joints])

    answers = [f"dry friction: {said(FRICTION)}"]
    if settings.stage == "mech":
        answers.append("hydraulics: one gain")
    else:
        answers += [
            f"compressible oil: {said(OIL)}",
            f"limit of the pump's flow: {said(PUMP)}",
        ]
    if SHARED in by_name:
        state = by_name[SHARED].state
        answers.append(f"joints share the pump: {'yes' if state == IN else 'no'}")
    return "; ".join(answers)
