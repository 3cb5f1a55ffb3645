"""The two stages of the article: which parameters are free, and where each enters (section 3, (15), (16))."""

from collections.abc import Sequence
from itertools import product

import numpy as np
from numpy.typing import NDArray

from hydroid.errors import SettingsError
from hydroid.hydraulics.records import nominal_parameters, without_actuator
from hydroid.parameters import Array
from hydroid.settings.arm import Arm
from hydroid.settings.fit import FitSettings
from hydroid.settings.hydraulics import QUANTITIES, TARGETS
from hydroid.settings.problem import MECHANICAL_UNITS, ParameterSettings
from hydroid.simulation import Candidates


class Stage:
    """Spreads a parameter vector over joints, links and actuators.

    Parameters of the arm are gains, dampers, springs, dry friction and link masses. Those that the settings
    do not name are 0; such a mass has its nominal value. Parameters of the actuators (stage hyd) may be any
    of their quantities; the others keep the values of the settings and the arm's file.

    Raises:
        SettingsError: a joint or link the arm lacks, or two parameters for the same thing.
    """

    def __init__(self, settings: FitSettings) -> None:
        arm = settings.arm
        self._arm, self._hydraulics = arm, settings.hydraulics if settings.stage == "hyd" else None
        self._slots = {name: _slots(arm, name, p) for name, p in settings.parameters.items()}
        self._quantities = {name: p.quantity for name, p in settings.parameters.items()}
        self._refuse_overlap()
        self.parameters = settings.parameter_set()

    def candidates(self, theta: Array) -> Candidates:
        """Spread theta, shape (n, P), over joints, links and actuators."""
        arm = {name: np.zeros((len(theta), len(self._arm.joint_names))) for name in MECHANICAL_UNITS}
        arm["mass"] = np.tile(self._arm.masses, (len(theta), 1))
        actuators = None
        if self._hydraulics is not None:
            joints = range(len(self._arm.joint_names))
            actuators = nominal_parameters(self._arm, self._hydraulics, joints, len(theta))
        for column, (name, slots) in enumerate(self._slots.items()):
            quantity = self._quantities[name]
            if quantity in arm:
                arm[quantity][:, slots] = theta[:, column, None]
            elif actuators is not None:
                for target in TARGETS[quantity]:
                    actuators[target][:, slots] = theta[:, column, None] * QUANTITIES[target].factor
        return Candidates(**arm, actuators=actuators)

    def refuse_idle(self, driven: NDArray[np.bool_], outputs: Sequence[int]) -> None:
        """Refuse driven, (J,), or compared joints, 0-based, that the model cannot move.

        Those are joints for which stage 1 has no gain or no damping, or stage 2 no actuator.
        """
        if self._hydraulics is not None:
            for joint in sorted({*np.flatnonzero(driven).tolist(), *outputs}):
                if joint < len(self._arm.joints) and self._arm.actuators[joint] is None:
                    raise without_actuator(self._arm, joint)
            return
        for quantity in ("gain", "damping"):
            serving = [slots for name, slots in self._slots.items() if self._quantities[name] == quantity]
            served = {slot for slots in serving for slot in slots}
            for joint in sorted({*np.flatnonzero(driven).tolist(), *outputs} - served):
                raise SettingsError(
                    f"joint {joint + 1} is driven or compared, but no parameter is its {quantity}",
                    where="parameters",
                    hint="add one, or leave the joint's command out with log.joints",
                )

    def _refuse_overlap(self) -> None:
        taken: dict[tuple[str, int], str] = {}
        for name, slots in self._slots.items():
            quantity = self._quantities[name]
            for target, slot in product(TARGETS.get(quantity, (quantity,)), slots):
                other = taken.setdefault((target, slot), name)
                if other != name:
                    raise SettingsError(
                        f"{other} and {name} both set the {target} of the same joint or link",
                        where=f"parameters.{name}",
                        hint="give each its own joints, or remove one",
                    )


def _slots(arm: Arm, name: str, settings: ParameterSettings) -> list[int]:
    """0-based joints or links that the parameter acts on."""
    where = f"parameters.{name}"
    if settings.link is not None:
        if settings.link not in arm.link_names:
            known = ", ".join(arm.link_names)
            raise SettingsError(f"no link {settings.link!r}", where=where, hint=f"links: {known}")
        return [arm.link_names.index(settings.link)]
    count = len(arm.joint_names)
    joints = settings.joints if settings.joints is not None else range(1, count + 1)
    if any(j > count for j in joints):
        raise SettingsError(f"the arm has joints 1 to {count}", where=f"{where}.joints")
    return [j - 1 for j in joints]
