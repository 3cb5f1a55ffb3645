"""Channels, the signals that are compared, one of one log each; and objectives: norms
of their errors (article 3.1) over segments of the log (3.2 and figure 18).

The error of equation (17), ε = y - ŷ, is an array (n, T): n candidates, T samples.
Equation (18) is a *mean* norm, (1/N Σ|ε|^p)^(1/p): the mean absolute error for p = 1,
the root mean square for p = 2. For p = inf it is the largest |ε|.

Equation (19) divides by "the p-norm of the measured data". We take the same mean norm
(18) of y, so that (19) has no unit and means the same for short and long segments. A
sum without 1/N would differ by a constant factor N^(-1/p) per segment.

A segment is a pair of sample indices [first, end). Segments cover the log without
overlap, and none is empty.
"""

from collections.abc import Iterator, Sequence
from typing import Literal, NamedTuple

import numpy as np

from hydroid.arrays import Array, Ints, record
from hydroid.errors import SettingsError
from hydroid.log import Log
from hydroid.settings.fit import FitSettings
from hydroid.settings.problem import ObjectiveSettings
from hydroid.simulation import Response

Quantity = Literal["angle", "pressure_a", "pressure_b"]
SIDES: tuple[Quantity, Quantity] = ("pressure_a", "pressure_b")
"""of a joint's pressures, in the order of a log's and a response's columns"""


@record
class Channel:
    """One signal of one log.

    Attributes:
        log: index of the log.
        joint: number, from 1.
        column: of the signal in the response's angles, or of its joint in the
            response's pressures.
        measured: [rad] or [Pa], shape (T,).
        weight: error times weight is the residual [rad]: no unit for an angle, rad/Pa
            for a pressure.
        rows: its residuals in a row of all channels' residuals.
    """

    log: int
    joint: int
    quantity: Quantity
    column: int
    measured: Array
    weight: float
    rows: slice

    def error(self, response: Response) -> Array:
        """Return the weighted output error y - y_hat of (17) in its log's response
        [rad], shape (n, T)."""
        if self.quantity == "angle":
            simulated = response.angle[:, :, self.column]
        else:
            side = SIDES.index(self.quantity)
            simulated = response.pressure[:, :, self.column, side]
        return self.weight * (self.measured - simulated)


def compared_pressures(log: Log, settings: FitSettings) -> list[int]:
    """Joints whose chamber pressures count in the objectives, 0-based: driven ones that
    the log measures."""
    pressure = log.pressure
    weight = settings.objective.pressure_weight
    if settings.stage != "hyd" or weight == 0 or pressure is None:
        return []
    # a joint whose first sample has no pressure has none anywhere
    measured = ~np.isnan(pressure[0]).all(axis=1)
    return np.flatnonzero(log.driven & measured).tolist()


def make_channels(logs: Sequence[Log], settings: FitSettings) -> tuple[Channel, ...]:
    """List the channels log by log, angles first."""
    channels = list[Channel]()
    end = 0
    for i, log in enumerate(logs):
        samples = len(log.time)
        for signal in (*_angles(log, settings), *_pressures(log, settings)):
            rows = slice(end, end + samples)
            end += samples
            channels.append(
                Channel(
                    log=i,
                    joint=signal.joint,
                    quantity=signal.quantity,
                    column=signal.column,
                    measured=signal.measured,
                    weight=signal.weight,
                    rows=rows,
                )
            )
    return tuple(channels)


class _Signal(NamedTuple):
    """A compared signal of one log, its fields as those of its `Channel`."""

    joint: int
    quantity: Quantity
    column: int
    measured: Array
    weight: float


def _angles(log: Log, settings: FitSettings) -> Iterator[_Signal]:
    weights = settings.objective.weights
    for column, joint in enumerate(settings.outputs):
        measured = log.angle_of(joint)
        yield _Signal(joint, "angle", column, measured, weights.get(joint, 1.0))


def _pressures(log: Log, settings: FitSettings) -> Iterator[_Signal]:
    weight = np.deg2rad(settings.objective.pressure_weight) / 1e5  # deg/bar -> rad/Pa
    for column, joint in enumerate(compared_pressures(log, settings)):
        assert log.pressure is not None
        for side, quantity in enumerate(SIDES):
            measured = log.pressure[:, joint, side]
            # one side may have no sensor
            if not np.isnan(measured[0]):
                yield _Signal(joint + 1, quantity, column, measured, weight)


def norm(error: Array, p: float | str) -> Array:
    """Return the p-norm (18) of each candidate's error, (n, T) -> (n,); p is 1, 2 or
    "inf".

    It is inf where the error is not finite or the norm overflows. A candidate's value
    does not depend, even in its last bit, on the other candidates.
    """
    # with the last axis contiguous numpy sums row by row; a transposed input would be
    # summed in another order
    size = np.abs(np.ascontiguousarray(error))
    with np.errstate(all="ignore"):
        if p == 1:
            value = size.mean(axis=-1)
        elif p == 2:
            value = np.sqrt((size * size).mean(axis=-1))
        else:
            value = size.max(axis=-1)
    return np.where(np.isfinite(value), value, np.inf)


def overall_objective(
    error: Array, measured: Array, settings: ObjectiveSettings
) -> Array:
    """Return the norm (18) of each candidate's error, (n, T) -> (n,); where relative,
    (19)."""
    value = norm(error, settings.norm)
    if not settings.relative:
        return value
    scale = norm(measured[None, :], settings.norm)[0]
    if scale == 0:
        raise SettingsError(
            "a relative norm has nothing to divide by: the measured output of a segment "
            "is zero throughout",
            "objective.relative",
            "use relative: false, or other segments",
        )
    return value / scale


def segment_objectives(
    error: Array, measured: Array, bounds: Ints, settings: ObjectiveSettings
) -> Array:
    """Return one objective per segment, equations (21) and (22), shape (n, S).

    A candidate whose error, (n, T), is not finite anywhere has inf in all segments: the
    first segments of a simulation that diverged later count for nothing. `bounds` are
    [first, end) of each segment in samples, (S, 2).
    """
    columns = list[Array]()
    for first, end in bounds:
        inside = error[:, first:end]
        columns.append(overall_objective(inside, measured[first:end], settings))
    objectives = np.stack(columns, axis=1)
    diverged = ~np.isfinite(objectives).all(axis=1)
    objectives[diverged] = np.inf
    return objectives


def segment_bounds(samples: int, segments: int) -> Ints:
    """Cut a log of so many samples into segments of equal length: [first, end) of
    each, shape (S, 2)."""
    if segments > samples:
        raise SettingsError(
            f"{segments} segments do not fit into {samples} samples",
            "objective.segments",
            "each segment needs a sample of its own",
        )
    edges = np.arange(segments + 1, dtype=np.int64) * samples // segments
    return np.stack((edges[:-1], edges[1:]), axis=1)
