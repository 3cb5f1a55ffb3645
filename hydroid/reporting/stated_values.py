"""The value of a quantity of the hydraulics in a fit: a parameter's, or what the settings
state."""

from hydroid.estimate import FitSummary, ParameterEstimate
from hydroid.quantity_table import QUANTITIES
from hydroid.reporting.parameters_report import origin
from hydroid.settings.fit import FitSettings
from hydroid.words import interval_words, value_words


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
    between = interval_words(*estimate.interval) or "no interval"
    words = value_words(value, *estimate.interval)
    return f"{words} {unit} ({between}; {origin(estimate)})"
