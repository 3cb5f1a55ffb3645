"""The parameters of a fit: their table, in words, and what the logs made of their
priors."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from hydroid.estimate import FitSummary, ParameterEstimate
from hydroid.files import Plain
from hydroid.findings import Finding
from hydroid.parameters import Parameter, Prior
from hydroid.posterior.uncertainty import Flag, Source
from hydroid.reporting.chart import Chart, Mark, Panel
from hydroid.reporting.held_values import held_table
from hydroid.reporting.page import Cell, Given, Plot, Section, Table
from hydroid.settings.fit import FitSettings
from hydroid.settings.naming import belongs_to, named, quantity_and_side
from hydroid.settings.parameters import nominal_value
from hydroid.words import interval_words, listed, three_digits, value_words

WHAT_IT_IS = ("joint", "side", "quantity", "symbol", "value", "unit")
"""columns with which every table of parameters begins"""
SIDES = {"A": "positive", "B": "negative"}
"""signs of the commands that open a side"""
NO_LIMITS = (None, None)
"""interval without an end"""
FARTHEST = 5.0
"""standard deviations of the prior up to which a posterior is drawn"""
OTHERWISE = 0.1
"""part of a mass by which one that is held differs noticeably from the arm's file"""
MOST_ALIKE = 3
"""parameters of the same words that a sentence names"""
ROW = 16
"""height of a parameter's row in a chart [px]"""
Row = dict[str, Cell]  # by the names of columns
Intervals = Mapping[str, tuple[float, float]]

_NOTE = "from, to: 95 % interval; empty: no limit. data: share of the information from the logs."
_BY_LOG = " by log: 95 %, estimated from how the logs differ."
_USE_BY_LOG = " Use it where it is given: the logs disagree."
_PRIORS = (
    "Grey: what was expected before the fit (95 %). Blue: what is known after it (95 %); "
    "points: the estimates. Where blue is as wide as grey, the logs added nothing."
)


def parameter_section(
    settings: FitSettings, summary: FitSummary, *points: str
) -> Section:
    """Return the section of all parameters. `points` are said first.

    It stands on paper even where it is folded.
    """
    text = ""
    free = {p.quantity for p in settings.parameters.values() if p.fixed is None}
    tells_pressure = "supply_pressure" in free or settings.objective.pressure_weight
    if settings.stage == "hyd" and not tells_pressure:
        # without pressures in the log only their product with the areas is known
        supply = three_digits(settings.hydraulics.supply_pressure)
        text = (
            "Areas, masses, torques and flows hold only for the supply pressure of the "
            f"settings, {supply} bar."
        )
    tables = {"parameters": short_table(settings, summary)}
    held = held_table(settings)
    if held.rows:
        tables["held"] = held
    at_bounds = _at_bounds(summary)
    count = sum(bool(estimate.at_bound) for estimate in summary.estimate.values())
    answer = f"{known_of_free(summary)}; at a bound: {count or 'none'}"
    said = [*held_masses(settings), *points]
    if at_bounds:
        said.insert(0, f"At a bound: {at_bounds}.")
    return Section(
        "Parameters",
        text,
        tuple(said),
        tables,
        folded=True,
        answer=answer,
        printed=True,
    )


def _at_bounds(summary: FitSummary) -> str:
    """Name the parameters at a bound; nothing where there are none."""
    names = list[str]()
    for name, estimate in summary.estimate.items():
        if estimate.at_bound:
            value = three_digits(estimate.value)
            names.append(f"{name} ({estimate.at_bound}, {value})")
    return listed(names) if names else ""


def held_masses(settings: FitSettings) -> list[str]:
    """Say which masses a fit holds at other values than the arm's file has."""
    said = list[str]()
    for name, parameter in settings.parameters.items():
        held = parameter.fixed
        if parameter.quantity != "mass" or held is None:
            continue
        expected = nominal_value(settings.arm, settings.hydraulics, parameter)
        if expected and abs(held - expected) > OTHERWISE * expected:
            said.append(
                f"This fit holds the {named(settings, name)} at {three_digits(held)} kg; "
                f"the arm's file says {three_digits(expected)} kg."
            )
    return said


def known_of_free(summary: FitSummary) -> str:
    """Say how many of the free parameters have an interval."""
    every = summary.estimate.values()
    free = [estimate for estimate in every if estimate.flag != Flag.FIXED]
    with_interval = sum(estimate.sd is not None for estimate in free)
    return f"{with_interval} of {len(free)} free parameters have an interval"


def prior_section(settings: FitSettings, summary: FitSummary) -> Section | None:
    """Return the section of what the logs made of the priors.

    None where no parameter has an interval.
    """
    every = summary.estimate.values()
    sources = [estimate.source for estimate in every if estimate.sd is not None]
    if not sources:
        return None
    plot = Plot("priors", _PRIORS, partial(prior_chart, settings, summary))
    answer = f"{sources.count(Source.DATA)} of {len(sources)} known from the logs"
    return Section("Prior and posterior", plots=(plot,), folded=True, answer=answer)


def short_table(settings: FitSettings, summary: FitSummary) -> Table:
    """Return one line per parameter for a reader: `parameter_table` has bounds and more
    digits."""
    intervals = _in_order(summary, ("interval",), ("by log",))
    columns = [*WHAT_IT_IS, *intervals, "source"]
    rows = list[Row]()
    for name in by_joint(settings, [*summary.estimate]):
        estimate = summary.estimate[name]
        source = origin(estimate)
        if estimate.data_share:
            source = shares_in_words(source, estimate.data_share)
        row = _what_it_is(settings, name, estimate)
        row["side"] = _side_and_word(settings, name, summary)
        # what a search leaves of 0 is 0
        is_zero = estimate.sd and abs(estimate.value) < 1e-9 * estimate.sd
        value = 0.0 if is_zero else estimate.value
        row["value"] = value_words(value, *estimate.interval)
        row["unit"] = estimate.unit
        row["interval"] = interval_words(*estimate.interval)
        row["by log"] = interval_words(*estimate.interval_by_log)
        row["source"] = source
        rows.append(row)
    note = "side A: positive commands, side B: negative ones. interval: 95 % confidence interval."
    if summary.left_out_deg:
        note += _BY_LOG
    if logs_disagree(summary):
        note += _USE_BY_LOG
    return Table.of("Parameters", {name: name for name in columns}, rows, note)


def logs_disagree(summary: FitSummary) -> bool:
    """Return whether the fit warns that intervals are too narrow, because its logs
    disagree, and that those by log are to be used."""
    return any(finding.kind == "logs disagree" for finding in summary.findings)


def _in_order(
    summary: FitSummary, plain: tuple[str, ...], by_log: tuple[str, ...]
) -> tuple[str, ...]:
    """Return the columns of both kinds of intervals, in front those that are to be used;
    those by log only where there are any."""
    if not summary.left_out_deg:
        return plain
    return by_log + plain if logs_disagree(summary) else plain + by_log


def shares_in_words(source: str, share: float) -> str:
    """Return words for a source, with the shares of data and prior where it is both."""
    percent = round(100 * share)
    return source.replace(Source.BOTH, f"{percent} % data, {100 - percent} % prior")


def first_joint(settings: FitSettings, name: str) -> int:
    """Return the first joint of a parameter, from 1; 0 of one that none has for
    itself."""
    parameter = settings.parameters.get(name)
    if parameter is None or not parameter.joints:
        return 0
    return parameter.joints[0]


def by_joint(settings: FitSettings, names: Sequence[str]) -> list[str]:
    """Return parameters in the order of their joints, so that those of one stand
    together; first those that no joint has for itself."""
    return sorted(names, key=partial(first_joint, settings))


def parameter_table(
    settings: FitSettings, summary: FitSummary, profiles: Intervals | None = None
) -> Table:
    """Return one row per parameter: what it is, estimate, intervals, bounds, and what
    it is known from.
    """

    by_log = ("by log from", "by log to") if summary.left_out_deg else ()
    columns = [*WHAT_IT_IS, *_in_order(summary, ("from", "to"), by_log)]
    if profiles:
        columns += ["profile from", "profile to"]
    columns += ["lower", "upper", "data [%]", "source"]
    rows = list[Row]()
    for parameter in settings.parameter_set().parameters:
        name = parameter.name
        estimate = summary.estimate[name]
        row = _what_it_is(settings, name, estimate)
        row["unit"] = parameter.unit
        row["from"], row["to"] = estimate.interval
        row["by log from"], row["by log to"] = estimate.interval_by_log
        row["profile from"], row["profile to"] = (profiles or {}).get(name, NO_LIMITS)
        row |= _bounds(settings, parameter)
        if estimate.data_share is not None:
            row["data [%]"] = 100 * estimate.data_share
        row["source"] = origin(estimate)
        rows.append(row)
    less_used = ("from", "to") if logs_disagree(summary) else by_log
    optional = ("quantity", "side", "joint", *less_used, "data [%]", "lower", "upper")
    shown = {name: name for name in columns}
    note = _NOTE + _BY_LOG if by_log else _NOTE
    return Table.of("Parameters", shown, rows, note, optional)


def _what_it_is(settings: FitSettings, name: str, estimate: ParameterEstimate) -> Row:
    """Return the columns with which every table of parameters begins, without the
    unit."""
    quantity, side = quantity_and_side(settings, name)
    return {
        "joint": belongs_to(settings, name),
        "side": side,
        "quantity": quantity,
        "symbol": name,
        "value": estimate.value,
    }


def _side_and_word(settings: FitSettings, name: str, summary: FitSummary) -> str:
    """Return the side of a parameter, with what the joint does then, where the fit
    knows."""
    side = quantity_and_side(settings, name)[1]
    word = ""
    joints = settings.parameters[name].joints or ()
    if side and len(joints) == 1:
        joint = settings.arm.joint_names[joints[0] - 1]
        word = direction_word(summary, joint, SIDES[side])
    return f"{side} ({word})" if word else side


def direction_word(summary: FitSummary, joint: str, towards: str) -> str:
    """Return what a command of a sign does with a joint (`CurveEstimate.moves`);
    nothing where the fit does not say it."""
    step = summary.curves.get(f"{joint}_step_{towards}")
    return step.moves if step else ""


def _bounds(settings: FitSettings, parameter: Parameter) -> Row:
    """Return the bounds of a parameter, the user's own as they are given; none of one
    that is fixed."""
    given = settings.parameters[parameter.name].bounds
    lower, upper = given or (parameter.lower, parameter.upper)
    if lower >= upper:
        return {}
    if given:
        return {"lower": Given(lower), "upper": Given(upper)}
    return {"lower": lower, "upper": upper}


def in_words(finding: Finding, settings: FitSettings) -> Finding:
    """Return a finding that names parameters in words.

    Those of the same words are named together.
    """
    groups = dict[str, list[str]]()
    details = dict(finding.details)
    for name in finding.subjects:
        words = name
        if name in settings.parameters:
            words, _ = quantity_and_side(settings, name)
        groups.setdefault(words, []).append(name)
    subjects = list[str]()
    for words, names in groups.items():
        if names == [words]:  # no parameter
            subjects.append(words)
        elif len(names) == 1:
            subjects.append(named(settings, names[0], details.pop(names[0], "")))
        else:
            symbols = [_with_detail(name, details) for name in names]
            subjects.append(f"{words} ({listed(symbols, MOST_ALIKE)})")
    return replace(finding, subjects=tuple(subjects), details=details)


def sentence(finding: Finding, settings: FitSettings) -> str:
    """Return what `in_words` makes of a finding, with a capital letter where a
    parameter's words begin it."""
    worded = in_words(finding, settings)
    text = str(worded)
    first = worded.subjects[0] if worded.subjects else ""
    # names of joints and logs are their users'
    if first and first not in finding.subjects and text.startswith(first):
        return text[0].upper() + text[1:]
    return text


def _with_detail(name: str, details: dict[str, str]) -> str:
    """Return a symbol with its detail, which is taken from the details."""
    return f"{name}: {details.pop(name)}" if name in details else name


def status(estimate: ParameterEstimate) -> str:
    """Say how well a parameter is known, in a few words; empty where its interval says
    it all."""
    flag = estimate.flag
    source = estimate.source
    # what a prior alone tells is as narrow as the prior: that is no news
    from_prior = source == Source.PRIOR and flag != Flag.NO_EFFECT
    words = list[str | None]()
    if flag != Flag.IDENTIFIABLE and not from_prior:
        words.append(flag)
    if source in (Source.BOTH, Source.PRIOR):
        words.append(source)
    if estimate.at_bound:
        words.append(f"at {estimate.at_bound} bound")
    return ", ".join(filter(None, words))


def origin(estimate: ParameterEstimate) -> str:
    """Say what a parameter is known from, and how well: data, for one that the logs
    determine."""
    return status(estimate) or estimate.source or ""


def prior_chart(settings: FitSettings, summary: FitSummary) -> Chart:
    """Draw the posterior of each parameter in standard deviations of its prior.

    Those without a prior are drawn between their bounds.
    """
    scores = dict[str, list[float]]()
    positions = dict[str, list[float]]()
    for parameter in settings.parameter_set().parameters:
        name = parameter.name
        estimate = summary.estimate[name]
        if estimate.sd is None:
            continue
        if parameter.prior is None:
            positions[name] = _position(estimate, parameter)
        else:
            scores[name] = _score(estimate, parameter.prior)
    panels = list[Panel]()
    if scores:
        rows = np.arange(float(len(scores)))
        low = np.full(len(scores), -1.96)
        look: Plain = {"color": "pale", "label": "prior, 95 %", "alpha": 0.6}
        prior = Mark("bars", low, rows, -low, **look)
        x = "standard deviations from the prior's value"
        panels.append(_bars("Beside their priors", x, scores, prior))
    if positions:
        x = "lower bound: 0; upper bound: 1"
        quantities = [settings.parameters[name].quantity for name in positions]
        curves = any(quantity.startswith("curve_") for quantity in quantities)
        shared = " (of the parts of a curve: they share a prior)" if curves else ""
        title = f"Without a prior, between their bounds{shared}"
        panels.append(_bars(title, x, positions))
    return Chart(tuple(panels))


def _score(estimate: ParameterEstimate, prior: Prior) -> list[float]:
    """Return estimate and ends of the interval in standard deviations from the prior's
    value."""
    low, high = estimate.interval
    ends = ((estimate.value, 0.0), (low, -FARTHEST), (high, FARTHEST))
    scores = list[float]()
    for value, without_limit in ends:
        score = without_limit
        if value is not None:
            # a logarithm needs more than 0
            least = 1e-12 * abs(prior.nominal) if prior.log else -np.inf
            score = prior.score(np.array(max(value, least)))
        scores.append(float(np.clip(score, -FARTHEST, FARTHEST)))
    return scores


def _position(estimate: ParameterEstimate, parameter: Parameter) -> list[float]:
    """Return estimate and ends of the interval on the parameter's scale between its
    bounds."""
    low, high = estimate.interval
    if low is None:
        low = parameter.lower
    if high is None:
        high = parameter.upper
    values = np.clip([estimate.value, low, high], parameter.lower, parameter.upper)
    return parameter.position(values).tolist()


def _bars(
    title: str, x: str, rows: Mapping[str, Sequence[float]], *behind: Mark
) -> Panel:
    """Draw the estimates of parameters and the ends of their intervals, each in a
    row."""
    value, low, high = np.array([*rows.values()]).T
    at = np.arange(float(len(rows)))
    label = "posterior, 95 %"
    marks = (
        *behind,
        Mark("bars", low, at, high, color="blue", label=label, alpha=0.5),
        Mark("points", value, at, color="blue", width=5, label="estimate"),
    )
    height = 70 + ROW * len(rows)
    return Panel(x, "", marks, title, height, rows=tuple(rows))
