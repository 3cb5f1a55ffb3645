"""Channels: the signals that are compared, one of one log each, and their places in a row of residuals."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from hydroid.arrays import Array
from hydroid.log import Log
from hydroid.settings.problem import ObjectiveSettings
from hydroid.simulation import Response

Quantity = Literal["angle", "pressure_a", "pressure_b"]
SIDES: tuple[Quantity, Quantity] = ("pressure_a", "pressure_b")


@dataclass(frozen=True, eq=False)
class Channel:
    """One signal of one log.

    Attributes:
        log: index of the log.
        joint: number, from 1.
        column: of the signal in the response's angles, or of its joint in the response's pressures.
        measured: [rad] or [Pa], shape (T,).
        weight: error times weight is the residual [rad]: no unit for an angle, rad/Pa for a pressure.
        rows: its residuals in a row of all channels' residuals.
    """

    log: int
    joint: int
    quantity: Quantity
    column: int
    measured: Array
    weight: float
    rows: slice

    def residual(self, responses: Sequence[Response] | Mapping[int, Response]) -> Array:
        """Return the weighted output error y - y_hat of (17) [rad], shape (n, T)."""
        response = responses[self.log]
        if self.quantity == "angle":
            simulated = response.angle[:, :, self.column]
        else:
            assert response.pressure is not None
            simulated = response.pressure[:, :, self.column, "ab".index(self.quantity[-1])]
        return self.weight * (self.measured - simulated)


def make_channels(
    logs: Sequence[Log],
    outputs: Sequence[int],
    pressures: Sequence[Sequence[int]],
    objective: ObjectiveSettings,
) -> tuple[Channel, ...]:
    """List the channels log by log, angles first.

    Compared are the angles of the joints `outputs`, and in log i the pressures of `pressures[i]`, 0-based.
    """
    signals: list[tuple[int, int, Quantity, int, Array, float]] = []
    for i, log in enumerate(logs):
        for column, joint in enumerate(outputs):
            weight = objective.weights.get(joint + 1, 1.0)
            signals.append((i, joint + 1, "angle", column, log.angle[:, joint], weight))
        for column, joint in enumerate(pressures[i]):
            assert log.pressure is not None
            weight = np.deg2rad(objective.pressure_weight) / 1e5  # deg/bar -> rad/Pa
            for side, quantity in enumerate(SIDES):
                measured = log.pressure[:, joint, side]
                if not np.isnan(measured[0]):
                    signals.append((i, joint + 1, quantity, column, measured, weight))
    ends = np.cumsum([len(measured) for *_, measured, _ in signals]).tolist()
    return tuple(
        Channel(*signal, slice(end - len(signal[4]), end)) for signal, end in zip(signals, ends, strict=True)
    )
