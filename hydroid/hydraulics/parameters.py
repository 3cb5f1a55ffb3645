"""What an actuator is: its parameters for a whole population, and the geometry that all candidates share."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from hydroid.hydraulics.solenoid import curve_exists
from hydroid.settings.arm import Arm, LinearActuator
from hydroid.settings.hydraulics import HYDRAULIC_UNITS, HydraulicSettings

Array = NDArray[np.float64]

NONE, LINEAR, ROTARY = 0, 1, 2
"""kinds of actuator; a joint with none keeps the constant torque that holds its start pose"""


@dataclass(frozen=True)
class Linkages:
    """How the J joints of a model are moved, (J,) each; the triangle is that of `hydroid.arm.linkage`.

    kind: NONE, LINEAR or ROTARY. a, b [m]: the pivots' distances. theta0 [rad]: the angle between them at
    joint angle 0. shortest [m]: cylinder length with the rod fully in, as at the joint's lower limit.
    stroke [m].
    """

    kind: NDArray[np.int64]
    a: Array
    b: Array
    theta0: Array
    shortest: Array
    stroke: Array

    @classmethod
    def of(cls, arm: Arm, joints: Sequence[int], driven: Sequence[int]) -> Linkages:
        """Return the linkages of some of an arm's joints.

        Args:
            arm: the arm's settings.
            joints: the moving joints, 0-based, in the order of the stepped model.
            driven: those among them that have a hydraulic actuator; the others get none.
        """
        rows = np.zeros((6, len(joints)))
        for row, j in zip(rows.T, joints, strict=True):
            actuator = arm.joints[j].actuator
            if j not in driven:
                continue
            row[0] = ROTARY
            if isinstance(actuator, LinearActuator):
                a, b, theta0 = actuator.a, actuator.b, math.radians(actuator.theta0)
                first = math.radians(arm.joints[j].range[0]) + theta0
                shortest = math.sqrt(a * a + b * b - 2 * a * b * math.cos(first))
                row[:] = LINEAR, a, b, theta0, shortest, 1e-3 * actuator.stroke
        return cls(rows[0].astype(np.int64), *rows[1:])


@dataclass(frozen=True)
class ActuatorParameters:
    """Parameters of n candidates' J actuators in SI, shape (n, J) each; what they are: `settings.hydraulics`.

    Of a rotary actuator area_a and area_b are displacements [m³/rad], dead_volume the constant volume of a
    chamber, dry_friction a torque [N·m]. flow_limit is inf where there is none.
    """

    area_a: Array
    area_b: Array
    opening_a: Array
    opening_b: Array
    onset_a: Array
    full_a: Array
    onset_b: Array
    full_b: Array
    current_max: Array
    current_min: Array
    force_1: Array
    force_2: Array
    stroke_1: Array
    stroke_2: Array
    rated_current: Array
    plunger_mass: Array
    plunger_damping: Array
    plunger_stiffness: Array
    slot_width: Array
    overlap_a: Array
    overlap_b: Array
    opening_exponent: Array
    leakage: Array
    flow_coefficient: Array
    transition_pressure: Array
    flow_limit: Array
    supply_pressure: Array
    tank_pressure: Array
    vapour_pressure: Array
    density: Array
    bulk_modulus: Array
    dead_volume: Array
    dry_friction: Array
    stop_penetration: Array
    delay: Array

    def __len__(self) -> int:
        return len(self.area_a)

    def __getitem__(self, rows: slice | NDArray[np.intp] | NDArray[np.bool_]) -> ActuatorParameters:
        return ActuatorParameters(**{f.name: getattr(self, f.name)[rows] for f in fields(self)})

    @property
    def feasible(self) -> NDArray[np.bool_]:
        """Which candidates have a force-stroke curve at every actuator, shape (n,)."""
        exists = curve_exists(self.force_1, self.force_2, self.stroke_1, self.stroke_2)
        return np.asarray(exists.all(axis=1), dtype=bool)

    def with_values(self, values: Mapping[str, Array]) -> ActuatorParameters:
        """Return the same with some quantities replaced, [drawing units], shapes that broadcast to (n, J)."""
        shape = np.broadcast_shapes(self.area_a.shape, *(np.shape(v) for v in values.values()))
        si = {name: np.asarray(value) * HYDRAULIC_UNITS[name][1] for name, value in values.items()}
        whole = {f.name: getattr(self, f.name) for f in fields(self)} | si
        return ActuatorParameters(**{k: np.array(np.broadcast_to(v, shape), float) for k, v in whole.items()})


def nominal_parameters(
    arm: Arm, settings: HydraulicSettings, joints: Sequence[int], candidates: int = 1
) -> ActuatorParameters:
    """Return what the settings say, the same for all candidates.

    Args:
        arm: the arm's settings, for areas and valve openings.
        settings: the hydraulics.
        joints: the moving joints, 0-based, in the order of the stepped model.
        candidates: n.
    """
    columns: list[list[float]] = []
    for j in joints:
        actuator = arm.joints[j].actuator
        values = settings.model_dump()
        values["flow_limit"] = settings.flow_limit or math.inf
        values["opening_a"] = values["opening_b"] = actuator.max_opening
        if isinstance(actuator, LinearActuator):
            values["area_a"], values["area_b"] = actuator.area_a, actuator.area_b
        else:
            values["area_a"] = values["area_b"] = actuator.displacement
            values["dead_volume"] = settings.rotary_volume
        columns.append([values[name] * factor for name, (_, factor) in HYDRAULIC_UNITS.items()])
    table = np.tile(np.array(columns).T[:, None, :], (1, candidates, 1))
    return ActuatorParameters(**dict(zip(HYDRAULIC_UNITS, table, strict=True)))
