"""Where each parameter of a fit enters the model (article section 3, equations (15) and
(16))."""

from collections.abc import Sequence

import numpy as np

from hydroid.arrays import Array, Mask
from hydroid.errors import SettingsError
from hydroid.hydraulics.records import Records, nominal_joints
from hydroid.quantity_table import QUANTITIES, TARGETS
from hydroid.settings.arm import Arm
from hydroid.settings.fit import FitSettings
from hydroid.settings.problem import ParameterSettings
from hydroid.simulation import Candidates


class Bindings:
    """Spreads a parameter vector over joints and links.

    Each column of theta sets one quantity of some joints, or the mass of a link; with a
    group of logs it is added to what is set otherwise, in these logs alone. What the
    settings do not name has its nominal value: 0 for gains, dampers, springs and dry
    friction, else what `hydraulics` and the arm's file say. Raises SettingsError: a
    joint or link the arm lacks, or two parameters for the same thing.
    """

    def __init__(self, settings: FitSettings) -> None:
        self._arm, self._stage, self._group_of = (
            settings.arm,
            settings.stage,
            settings.log.group_of,
        )
        self._nominal = nominal_joints(settings.arm, settings.hydraulics)
        rows = [
            (column, quantity, _places(settings.arm, name, p), p.per)
            for column, (name, p) in enumerate(settings.parameters.items())
            for quantity in TARGETS[p.quantity]
        ]
        # what is added comes last
        self._rows = sorted(rows, key=lambda row: row[-1] is not None)
        names, taken = (
            list(settings.parameters),
            dict[tuple[str, int, str | None], str](),
        )
        for column, quantity, places, group in self._rows:
            name = names[column]
            for place in places:
                if (other := taken.setdefault((quantity, place, group), name)) != name:
                    raise SettingsError(
                        f"{other} and {name} both set the {quantity} of the same joint or link",
                        f"parameters.{name}",
                        "give each its own joints, or remove one",
                    )

    def candidates(self, theta: Array, log: str = "") -> Candidates:
        """Spread theta, shape (n, P), over joints and links, in SI, as they are in a
        log of this name."""
        own = self._group_of(log)
        joints: Records = np.tile(self._nominal, (len(theta), 1)).view(np.recarray)
        mass = np.tile(self._arm.masses, (len(theta), 1))
        for column, quantity, places, group in self._rows:
            target = mass if quantity == "mass" else joints[quantity]
            value, factor = theta[:, column, None], QUANTITIES[quantity].factor
            if group is None:
                target[:, places] = value * factor
            elif group == own:
                least = QUANTITIES[quantity].lowest
                target[:, places] = np.maximum(
                    target[:, places] + value * factor, least * factor
                )
        return Candidates(joints, mass)

    def refuse_idle(self, driven: Mask, outputs: Sequence[int]) -> None:
        """Refuse driven, (J,), or compared joints, 0-based, for which stage 1 has no
        gain or no damping."""
        moved = {*np.flatnonzero(driven).tolist(), *outputs}
        for quantity in ("gain", "damping") if self._stage == "mech" else ():
            served = {
                place
                for _, what, places, _ in self._rows
                if what == quantity
                for place in places
            }
            for joint in sorted(moved - served)[:1]:
                raise SettingsError(
                    f"joint {joint + 1} is driven or compared, but no parameter is its {quantity}",
                    "parameters",
                    "add one, or leave the joint's command out with log.joints",
                )


def _places(arm: Arm, name: str, settings: ParameterSettings) -> list[int]:
    """0-based joints or links that the parameter acts on."""
    where = f"parameters.{name}"
    if settings.link is not None:
        if settings.link not in arm.link_names:
            raise SettingsError(
                f"no link {settings.link!r}",
                where,
                f"links: {', '.join(arm.link_names)}",
            )
        return [arm.link_names.index(settings.link)]
    count = len(arm.joint_names)
    joints = range(1, count + 1) if settings.joints is None else settings.joints
    if any(joint > count for joint in joints):
        raise SettingsError(f"the arm has joints 1 to {count}", f"{where}.joints")
    return [joint - 1 for joint in joints]
