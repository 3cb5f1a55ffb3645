"""What can be measured on the actuators of a simulated arm, beside its angles."""

from dataclasses import dataclass

import numpy as np

from hydroid.arrays import Array, Structs
from hydroid.hydraulics.actuator import pressures
from hydroid.hydraulics.records import JOINT_STATE, Records
from hydroid.mjcf import quiet_mujoco
from hydroid.simulation import Candidates
from hydroid.simulation.rollout import Course, Trace
from hydroid.simulation.scenario import Chain, Scenario


@dataclass(frozen=True, eq=False)
class Observation:
    """Flows are means over the last step. Joints without an actuator have zeros.

    pressure [Pa], shape (n, J, 2): chambers A and B. flow [m³/s], shape (n, J, 2): into
    A and out of B. spool [m], shape (n, J). force [N], shape (n, J): A_A p_A − A_B p_B;
    of a rotary actuator a torque [N·m]. line [Pa], shape (n, J): pressure of the pump's
    line, the same at all joints.
    """

    pressure: Array
    flow: Array
    spool: Array
    force: Array
    line: Array


def observe(coefficients: Structs, state: Structs, angle: Array) -> Observation:
    """Observe COEFFICIENTS and states at `angle` [rad], shape (n, J), as `pressures`
    does."""
    c: Records = coefficients.view(np.recarray)
    z: Records = state.view(np.recarray)
    pressure = pressures(coefficients, state, angle)
    force = c.a.area * pressure[..., 0] - c.b.area * pressure[..., 1]
    flow = np.stack([z.a.flow, -z.b.flow], axis=-1)
    return Observation(pressure, flow, z.a.stroke - z.b.stroke, force, z.line.copy())


def trace(scenario: Scenario, candidates: Candidates) -> Observation:
    """Simulate one candidate; what its actuators did at T samples, shape (T, J) or (T,
    J, 2)."""
    stepping, pose = scenario.stepping, scenario.arm.pose
    steps = stepping.steps
    chain = Chain(scenario.machine, scenario.arm, scenario.roles, stepping)
    arm = chain.stepped(scenario.arm.model, steps)
    with quiet_mujoco():
        balance = arm.start(scenario.values(candidates), [0], pose)
        plugin, states = chain.start(candidates, pose, balance[None], scenario.pressure)
        one, samples = plugin.candidate(0), 1 + len(scenario.command) // steps
        record = np.zeros((samples, len(states[0])), JOINT_STATE)
        angle, record[0] = np.tile(pose, (len(record), 1)), states[0]
        commands = np.concatenate(
            [np.zeros((one.past, len(states[0]))), scenario.command[:, chain.columns]]
        )
        course = Course(
            commands,
            np.empty((len(scenario.command), 0)),
            conditions=scenario.conditions,
        )
        arm.roll(one, states[0], course, Trace(angle[1:], record[1:]))
    return observe(one.coefficients, record, angle[:, chain.columns])
