"""Parameters in words: what a symbol stands for, where it acts, and on which side."""

from hydroid.quantity_table import CHOICES
from hydroid.settings.fit import FitSettings


def quantity_and_side(settings: FitSettings, name: str) -> tuple[str, str]:
    """Return what a parameter is, in words, and the side of the actuator that it
    belongs to, if any.
    """
    plain, _, side = CHOICES[settings.parameters[name].quantity].plain.partition(
        ", side "
    )
    return plain, side


def place(settings: FitSettings, name: str) -> str:
    """Return the link or the joints that a parameter belongs to; empty where all share
    it."""
    own = settings.parameters[name]
    if own.link is not None:
        return own.link
    where = ", ".join(settings.arm.joint_names[joint - 1] for joint in own.joints or ())
    return f"{where} ({own.per})" if own.per else where


def named(settings: FitSettings, name: str, detail: str = "") -> str:
    """Name a parameter in words, with joint, side, symbol, and a `detail` in brackets
    behind them.

    What is no parameter keeps its name.
    """
    if name not in settings.parameters:
        return f"{name} ({detail})" if detail else name
    what, side = quantity_and_side(settings, name)
    where = f"{place(settings, name)} {side}".strip()
    symbol = f"{where}: {name}" if where else name
    return f"{what} ({symbol}; {detail})" if detail else f"{what} ({symbol})"
