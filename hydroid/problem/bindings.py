"""Where each parameter of a fit enters the model (article section 3, equations (15) and
(16))."""

from collections.abc import Sequence

import numpy as np

from hydroid.arrays import Array, Ints, Mask, record
from hydroid.errors import SettingsError
from hydroid.hydraulics.records import nominal_joints
from hydroid.quantity_table import QUANTITIES, TARGETS
from hydroid.search.axes import SHARED
from hydroid.settings.arm import Arm
from hydroid.settings.fit import FitSettings
from hydroid.settings.problem import ParameterSettings
from hydroid.simulation import Candidates


@record
class Binding:
    """What one parameter sets, or changes in some logs.

    Attributes:
        column: of the parameter in theta.
        quantity: of joints, or the mass of links.
        targets: these joints or links, 0-based.
        group: of the logs in which it is added to what is set otherwise; None: it sets
            the quantity in all.
    """

    column: int
    quantity: str
    targets: list[int]
    group: str | None


class Bindings:
    """Spreads a parameter vector over joints and links.

    Each column of theta sets one quantity of some joints, or the mass of a link; with a
    group of logs it is added to what is set otherwise, in these logs alone. What the
    settings do not name has its nominal value: 0 for gains, dampers, springs and dry
    friction, else what `hydraulics` and the arm's file say. Raises SettingsError: a
    joint or link the arm lacks, or two parameters for the same thing.
    """

    def __init__(self, settings: FitSettings) -> None:
        self._arm = settings.arm
        self._stage = settings.stage
        self.group_of = settings.log.group_of
        self._nominal = nominal_joints(settings.arm, settings.hydraulics)
        self._columns = len(settings.parameters)
        bindings: list[Binding] = []
        for column, (name, parameter) in enumerate(settings.parameters.items()):
            targets = _targets(settings.arm, name, parameter)
            for quantity in TARGETS[parameter.quantity]:
                bindings.append(Binding(column, quantity, targets, parameter.per))
        # what is added comes last
        self._bindings = sorted(bindings, key=lambda binding: binding.group is not None)
        self._refuse_doubled(list(settings.parameters))

    def _refuse_doubled(self, names: Sequence[str]) -> None:
        """Refuse two parameters, by their names, for the same thing."""
        taken = dict[tuple[str, int, str | None], str]()
        for binding in self._bindings:
            name = names[binding.column]
            for target in binding.targets:
                key = (binding.quantity, target, binding.group)
                other = taken.setdefault(key, name)
                if other == name:
                    continue
                raise SettingsError(
                    f"{other} and {name} both set the {binding.quantity} of the same "
                    "joint or link",
                    f"parameters.{name}",
                    "give each its own joints, or remove one",
                )

    def owners(self) -> Ints:
        """Return the joint, 0-based, that each parameter acts on alone, shape (P,), or
        SHARED: a link's mass loads other joints too."""
        owner = np.full(self._columns, SHARED)
        for binding in self._bindings:
            if binding.quantity != "mass" and len(binding.targets) == 1:
                owner[binding.column] = binding.targets[0]
        return owner

    def candidates(self, theta: Array, log: str = "") -> Candidates:
        """Spread theta, shape (n, P), over joints and links, in SI, as they are in a
        log of this name."""
        return self.of_group(theta, self.group_of(log))

    def of_group(self, theta: Array, group: str) -> Candidates:
        """Return the same as they are in the logs of a group."""
        # what no parameter sets keeps its nominal value
        joints = np.tile(self._nominal, (len(theta), 1))
        mass = np.tile(self._arm.masses, (len(theta), 1))
        for binding in self._bindings:
            table = mass
            if binding.quantity != "mass":
                table = joints[binding.quantity]
            quantity = QUANTITIES[binding.quantity]
            value = theta[:, binding.column, None] * quantity.factor
            if binding.group is None:
                table[:, binding.targets] = value
            elif binding.group == group:
                # on top of what is set for all logs, but never beyond what can be
                changed = table[:, binding.targets] + value
                least = quantity.lowest * quantity.factor
                most = quantity.highest * quantity.factor
                table[:, binding.targets] = changed.clip(least, most)
        return Candidates(joints.view(np.recarray), mass)

    def refuse_idle(self, driven: Mask, outputs: Sequence[int]) -> None:
        """Refuse driven, (J,), or compared joints, 0-based, for which stage 1 has no
        gain or no damping."""
        if self._stage != "mech":
            return
        moved = {*np.flatnonzero(driven).tolist(), *outputs}
        for quantity in ("gain", "damping"):
            served = set[int]()
            for binding in self._bindings:
                if binding.quantity == quantity:
                    served.update(binding.targets)
            idle = moved - served
            if idle:
                raise SettingsError(
                    f"joint {min(idle) + 1} is driven or compared, but no parameter is "
                    f"its {quantity}",
                    "parameters",
                    "add one, or leave the joint's command out with log.joints",
                )


def _targets(arm: Arm, name: str, settings: ParameterSettings) -> list[int]:
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
    count = len(arm.joints)
    joints = settings.joints
    if joints is None:
        return list(range(count))
    if any(joint > count for joint in joints):
        raise SettingsError(f"the arm has joints 1 to {count}", f"{where}.joints")
    return [joint - 1 for joint in joints]
