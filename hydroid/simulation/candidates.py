"""Candidates in, responses out: what every simulation of a population takes and returns."""

from collections.abc import Callable
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from hydroid.hydraulics.records import Records

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Candidates:
    """Physical values of n candidates; J joints and L links in the arm's order.

    gain [N·m/%], damping [N·m·s/rad], stiffness [N·m/rad], friction [N·m]: shape (n, J).
    mass [kg]: shape (n, L). actuators: in stage 2, of all J joints.
    """

    gain: Array
    damping: Array
    stiffness: Array
    friction: Array
    mass: Array
    actuators: Records | None = None

    def __len__(self) -> int:
        return len(self.mass)

    def __getitem__(self, rows: slice | NDArray[np.intp]) -> "Candidates":
        values = {f.name: getattr(self, f.name) for f in fields(self)}
        return Candidates(**{name: None if v is None else v[rows] for name, v in values.items()})


@dataclass(frozen=True)
class Response:
    """Simulated angles [rad], shape (n, T, K), of the K output joints.

    A candidate that diverged has `feasible` False, shape (n,), and NaN throughout. `pressure` [Pa], shape
    (n, T, L, 2), are those of chambers A and B of L joints, where they were asked for.
    """

    angle: Array
    feasible: NDArray[np.bool_]
    pressure: Array | None = None


def in_chunks(simulate: Callable[[Candidates], Response], candidates: Candidates, size: int) -> Response:
    """Simulate candidates `size` at a time: memory for the steps does not grow with their number."""
    parts = [simulate(candidates[i : i + size]) for i in range(0, len(candidates), size)]
    pressures = [p.pressure for p in parts if p.pressure is not None]
    return Response(
        np.concatenate([p.angle for p in parts]),
        np.concatenate([p.feasible for p in parts]),
        np.concatenate(pressures) if pressures else None,
    )
