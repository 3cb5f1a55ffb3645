"""What a model predicts for a log: commands in; angles, pressures and flows out."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from hydroid.arm.model import load_model
from hydroid.arrays import Array, record
from hydroid.errors import RunError
from hydroid.identified_model import IdentifiedModel
from hydroid.log import Log
from hydroid.problem.bindings import Bindings
from hydroid.simulation import Response, make_simulation
from hydroid.simulation.roles import roles


@record
class OilTrace:
    """What the oil of a log's K compared joints does in a simulation of T samples.

    Attributes:
        pressure: of chambers A and B [Pa], shape (T, K, 2); NaN of joints that the log
            does not drive.
        flow: into these chambers [m³/s], a mean over the last step, shape (T, K, 2);
            below 0 out of them; NaN as the pressures.
        line: pressure of the pump's line [Pa], shape (T,); None: its flow has no limit.
    """

    pressure: Array
    flow: Array
    line: Array | None


def predict(model: IdentifiedModel, log: Log, joints: Sequence[int]) -> Array:
    """Return angles [rad] of joints, numbered from 1, for a log's commands, (T, K); NaN
    if it diverged."""
    return _respond(model, log, [j - 1 for j in joints]).angle[0]


def predict_with_oil(
    model: IdentifiedModel, log: Log, joints: Sequence[int]
) -> tuple[Array, OilTrace | None]:
    """Return angles as `predict` does, and what the oil does; None of a model without
    hydraulics.

    The angles are the same to the bit.
    """
    if model.settings.stage != "hyd":
        return predict(model, log, joints), None
    columns = [joint - 1 for joint in joints]
    driven = [column for column in columns if log.driven[column]]
    response = _respond(model, log, columns, driven)
    places = [columns.index(column) for column in driven]
    pressure = np.full((len(log.time), len(joints), 2), np.nan)
    pressure[:, places] = response.pressure[0]
    flow = np.full(pressure.shape, np.nan)
    flow[:, places] = response.flow[0]
    line = np.empty(0)
    if driven:
        line = response.line[0]
    has_pump = np.isfinite(line).any()
    return response.angle[0], OilTrace(pressure, flow, line if has_pump else None)


def predict_log(model: IdentifiedModel, log: Log) -> Log:
    """Return the log with the angles that the model gives for its commands, from its
    first pose.

    Locked joints stay where they start; prescribed joints keep their logged motion.
    Stage 2 also gives the chamber pressures of driven joints for which `log.pressure`
    maps columns.
    """
    settings = model.settings
    of_joints = roles(log.driven, settings.simulation.other_joints)
    moving = np.flatnonzero(of_joints.simulated).tolist()
    angle = log.posed.copy()
    angle[:, ~of_joints.moving] = log.start[~of_joints.moving]
    hydraulic = log.driven & (settings.stage == "hyd")
    measured = [
        j
        for j in np.flatnonzero(hydraulic).tolist()
        if settings.log.columns("pressure", j + 1)
    ]
    response = _respond(model, log, moving, measured)
    if not np.isfinite(response.angle).all():
        raise RunError("the simulation diverged with these parameters", model.source)
    angle[:, moving] = response.angle[0]
    pressure = None
    if measured:
        # the pressures of an idle cylinder are not simulated
        pressure = np.zeros((*angle.shape, 2))
        pressure[:, measured] = response.pressure[0]
    return replace(log, angle=angle, pressure=pressure)


def _respond(
    model: IdentifiedModel, log: Log, outputs: list[int], pressures: Sequence[int] = ()
) -> Response:
    """Simulate the angles of `outputs` and the pressures of some joints, 0-based."""
    settings = model.settings
    bindings = Bindings(model.settings)
    simulation = make_simulation(
        load_model(settings.arm), log, outputs, settings, pressures
    )
    return simulation.simulate(bindings.candidates(model.theta[None], log.source))
