"""The value of a quantity of the hydraulics in a fit: a parameter's, or what the settings
state."""

from hydroid.estimate import (
    FitSummary,
    Interval,
    ParameterEstimate,
    QuantityEstimate,
)
from hydroid.quantity_table import QUANTITIES
from hydroid.reporting.parameters_report import (
    logs_disagree,
    origin,
    shares_in_words,
)
from hydroid.settings.fit import FitSettings
from hydroid.words import interval_words, value_and_interval, value_words

MOSTLY = 0.5
"""share of the information below which the logs gave the lesser part of it"""


def value_of(
    settings: FitSettings, summary: FitSummary, quantity: str, joint: int | None = None
) -> tuple[float | None, ParameterEstimate | None]:
    """Return the value of a quantity, such as `dead_band_a` or `pump_flow`, and its
    estimate, None where the fit does not estimate it.

    `joint` is that of a quantity that joints have. None as a value: the model has none.
    """
    # a parameter of a quantity without its side is of both
    names = (quantity, quantity.removesuffix("_a").removesuffix("_b"))
    for name, parameter in settings.parameters.items():
        is_here = joint in (parameter.joints or (joint,))
        # an effect of a group of logs adds to the value
        is_effect = parameter.per is not None
        if is_here and not is_effect and parameter.quantity in names:
            estimate = summary.estimate[name]
            is_free = parameter.fixed is None
            return estimate.value, estimate if is_free else None
    return getattr(settings.hydraulics, quantity), None


def value_and_origin(
    settings: FitSettings, summary: FitSummary, quantity: str, joint: int | None = None
) -> str:
    """Write a quantity with its unit, its interval, and what it is known from."""
    value, estimate = value_of(settings, summary, quantity, joint)
    unit = QUANTITIES[quantity].unit
    if value is None:
        return "none in this model"
    if estimate is None:
        return f"{value:g} {unit} (fixed)"
    interval = interval_to_use(summary, estimate)
    between = interval_words(*interval) or "no interval"
    words = value_words(value, *interval)
    source = shares_in_words(origin(estimate), estimate.data_share or 0.0)
    return f"{words} {unit} ({between}; {source})"


def interval_to_use(summary: FitSummary, estimate: ParameterEstimate) -> Interval:
    """Return the 95 % interval of a parameter that the page tells its readers to use: that
    by log, if there is one, where the logs disagree."""
    has_by_log = estimate.interval_by_log != (None, None)
    if logs_disagree(summary) and has_by_log:
        return estimate.interval_by_log
    return estimate.interval


def in_heading(
    summary: FitSummary, estimate: ParameterEstimate | QuantityEstimate, unit: str = ""
) -> str:
    """Write a value with its interval for a heading, and that it is mostly the prior's
    where it is, as "0.43 ± 0.03 s (mostly prior)"."""
    interval = estimate.interval
    if isinstance(estimate, ParameterEstimate):
        interval = interval_to_use(summary, estimate)
    words = f"{value_and_interval(estimate.value, *interval)} {unit}".strip()
    return f"{words} (mostly prior)" if is_mostly_prior(estimate) else words


def is_mostly_prior(estimate: ParameterEstimate | QuantityEstimate) -> bool:
    """Return whether the logs gave the lesser part of what is known of a value; no of one
    that has no interval."""
    share = estimate.data_share
    return share is not None and share < MOSTLY
