"""Parameters in words: what a symbol stands for, where it acts, and on which side."""

from hydroid.quantity_table import CHOICES
from hydroid.settings.fit import FitSettings


def quantity_and_side(settings: FitSettings, name: str) -> tuple[str, str]:
    """Return what a parameter is, in words, and the side of the actuator that it
    belongs to, if any.
    """
    quantity = CHOICES[settings.parameters[name].quantity]
    words, _, side = quantity.plain.partition(", side ")
    return words, side


def belongs_to(settings: FitSettings, name: str) -> str:
    """Return the link or the joints that a parameter belongs to; empty where all share
    it."""
    parameter = settings.parameters[name]
    if parameter.link is not None:
        return parameter.link
    every = settings.arm.joint_names
    joints = ", ".join(every[number - 1] for number in parameter.joints or ())
    if parameter.per:
        return f"{joints} ({parameter.per})"
    return joints


def named(settings: FitSettings, name: str, detail: str = "") -> str:
    """Name a parameter in words, with joint, side, symbol, and a `detail` in brackets
    behind them.

    What is no parameter keeps its name.
    """
    if name not in settings.parameters:
        return f"{name} ({detail})" if detail else name
    words, side = quantity_and_side(settings, name)
    where = f"{belongs_to(settings, name)} {side}".strip()
    inside = name
    if where:
        inside = f"{where}: {name}"
    if detail:
        inside = f"{inside}; {detail}"
    return f"{words} ({inside})"
