"""What a simulation costs, and what hydroid adds to it: ratios inside one run.

A population (70 candidates, 7,500 steps, objectives included) against
`mujoco.batch.Batch.rollout` alone on the same model and candidates, set up beforehand;
`locked` against `passive`; both stages; how fast a plant steps, as a multiple of real
time; and the excavator's derivatives in both models of stage 2.

--together: only how fast many plants, and environments of gymnasium, step in one call.
"""

import sys
import time
from collections.abc import Callable, Mapping
from functools import partial

import mujoco
import numpy as np
from common import EXAMPLES, pseudo_random_log, row, table
from made_logs import TRUTH, simulate_log
from mujoco.batch import Batch

from hydroid import load_settings, read_logs
from hydroid.arm.locked import lock
from hydroid.arm.model import load_model
from hydroid.plant import Plant, PlantBatch, load_plant
from hydroid.problem.problem import Problem
from hydroid.use.environment import VectorEnv

CANDIDATES, REPEATS = 70, 9
MACHINES = 64
"""plants, and environments, in one call"""
HELD = 5
"""steps for which an environment holds an action"""
EPISODE = 101
"""actions after which every machine has begun anew once"""
ALL = list(range(1, 8))


def make_problem(config: str, joints: list[int], other_joints: str) -> Problem:
    """A problem whose data are commands of some joints, and stage 1's response to them
    at the truth."""
    settings = load_settings(config, {"simulation.other_joints": other_joints})
    log = pseudo_random_log(settings.arm.pose("study"), joints, duration=75.01)
    return Problem(
        settings,
        [simulate_log(settings, log, TRUTH) if config == "article-mech" else log],
    )


def population(problem: Problem) -> np.ndarray:
    unit = np.random.default_rng(0).random(
        (CANDIDATES, int(problem.parameters.free.sum()))
    )
    return problem.parameters.from_unit(unit)


def bare_rollout(problem: Problem) -> Callable[[], object]:
    """Return MuJoCo's own rollout of the same candidates, written without hydroid's
    simulation."""
    log, arm = problem.logs[0], problem.settings.arm
    candidates = problem.bindings.candidates(population(problem))
    passive = problem.settings.simulation.other_joints == "passive"
    moving = np.arange(log.joints) if passive else np.array([1])
    reduced = lock(
        load_model(arm), arm, np.isin(range(log.joints), moving), log.angle[0]
    )
    reduced.model.qpos_spring[:] = log.angle[0, moving]
    batch = Batch(reduced.model, nsim=CANDIDATES)
    for name, value in reduced.inertials(candidates.mass).items():
        batch.expand(name)[:] = value
    batch.expand("dof_damping")[:] = candidates.joints.damping[:, moving]
    batch.expand("jnt_stiffness")[:] = candidates.joints.stiffness[:, moving]
    batch.set_const()
    batch.reset()
    batch.bind("qpos")[:] = log.angle[0, moving]
    batch.forward()
    gained = candidates.joints.gain[:, None, moving] * log.command[:-1, moving]
    torque, steps = batch.bind("qfrc_bias")[:, None] + gained, len(log.time) - 1
    out = {"qpos": np.empty((CANDIDATES, steps, len(moving)))}

    def roll() -> None:
        batch.reset()
        batch.bind("qpos")[:] = log.angle[0, moving]
        batch.rollout(
            steps, torque, mujoco.mjtState.mjSTATE_QFRC_APPLIED.value, out=out
        )

    return roll


def in_turn(calls: Mapping[str, Callable[[], object]]) -> dict[str, np.ndarray]:
    """Seconds of each call in every round, shape (REPEATS,)."""
    rounds = dict[str, list[float]]()
    for _ in range(1 + REPEATS):  # the first one compiles and warms up
        for name, call in calls.items():
            started = time.perf_counter()
            call()
            rounds.setdefault(name, []).append(time.perf_counter() - started)
    return {name: np.array(times[1:]) for name, times in rounds.items()}


def derivatives(model: str) -> Callable[[], object]:
    """Return the excavator's simulations of one Jacobian: candidates that differ in one
    parameter each."""
    folder, steps = (
        EXAMPLES / "excavator",
        {"simulation.steps_per_sample": 5} if model == "dynamic" else {},
    )
    settings = load_settings(folder / "fit.yaml", {"simulation.model": model} | steps)
    problem = Problem(
        settings, read_logs(sorted(folder.glob("fit_0[12].csv")), settings)
    )
    theta = np.tile(problem.parameters.start, (int(problem.parameters.free.sum()), 1))
    theta[range(len(theta)), np.flatnonzero(problem.parameters.free)] += 1e-6
    return partial(problem.output_errors, theta)


def plant_steps(joints: list[int], steps: int = 2000) -> tuple[float, float]:
    """Return the seconds that a step of a plant with hydraulics on some joints takes,
    and its period."""
    plant = load_plant("article-hyd", overrides={"start_pose": "study"}, joints=joints)
    commands = (
        30.0
        * np.isin(ALL, joints)
        * np.sin(np.arange(steps)[:, None] / 50 + np.arange(7))
    )

    def run() -> None:
        plant.reset()
        for command in commands:
            plant.step(command)

    return min(in_turn({"plant": run})["plant"]) / steps, plant.period


def together(model: str) -> tuple[float, float, float, float]:
    """Return the steps per second of 64 plants in one call, those of 64 environments
    (use.environment), the latter per second of CPU time, and the part of this time that
    the same plants take by themselves.

    Two threads; an action is held for five steps, which count as one of an environment.
    In each round every machine begins one episode anew, once all have been in all poses
    in which episodes begin.
    """
    plant = load_plant(
        "article-hyd",
        overrides={"start_pose": "study", "simulation.model": model},
        joints=[2],
    )
    batch, held = (
        PlantBatch(
            [
                Plant(
                    plant.identified,
                    joints=[2],
                    period=steps * plant.period,
                    shapes=False,
                )
                for _ in range(MACHINES)
            ],
            threads=2,
        )
        for steps in (1, HELD)
    )
    envs = VectorEnv(plant.identified, MACHINES, seed=None)
    envs.reset(seed=0)
    for _ in range(100):
        envs.reset()
    rng = np.random.default_rng(0)
    shape = EPISODE, MACHINES, 1
    commands = 30.0 * rng.uniform(-1.0, 1.0, shape)
    actions = rng.uniform(-0.3, 0.3, shape).astype(np.float32)
    cpu = dict[str, list[float]]()

    def timed(name: str, step: Callable[[np.ndarray], object], given: np.ndarray):
        def run() -> None:
            began = time.process_time()
            for one in given:
                step(one)
            cpu.setdefault(name, []).append(time.process_time() - began)

        return run

    calls = {
        "batch": timed("batch", batch.hold, commands),
        "held": timed("held", held.hold, commands),
        "envs": timed("envs", envs.step, actions),
    }
    took = in_turn(calls)
    each = MACHINES * EPISODE
    least = {name: min(times) for name, times in cpu.items()}
    simulated = least["held"] / least["envs"]
    rates = each / min(took["batch"]), each / min(took["envs"]), each / least["envs"]
    return *rates, simulated


if __name__ == "__main__":
    if "--together" in sys.argv[1:]:
        table(
            "model | steps/s of 64 plants in a call | actions/s of 64 environments | "
            "per second of CPU time | of it the simulation"
        )
        for name in ("quasi-static", "dynamic"):
            plants, envs, cpu, part = together(name)
            row(f"{name} | {plants:.0f} | {envs:.0f} | {cpu:.0f} | {100 * part:.0f} %")
        raise SystemExit
    problems = {
        name: make_problem("article-mech", [2], name) for name in ("passive", "locked")
    }
    calls = {
        f"{name}, bare": bare_rollout(problem) for name, problem in problems.items()
    }
    problems |= {
        f"hydraulics of {len(j)}": make_problem("article-hyd", j, "passive")
        for j in ([2], ALL)
    }
    took = in_turn(
        {name: partial(p.evaluate, population(p)) for name, p in problems.items()}
        | calls
    )
    table(
        "joints besides the shoulder | evaluation [s] | Batch.rollout alone [s] | ratio | evaluations/s"
    )
    for name in ("passive", "locked"):
        middle, alone = np.median(took[name]), took[f"{name}, bare"]
        ratio, rate = np.median(alone / took[name]), CANDIDATES / middle
        row(
            f"{name} | {middle:.3f} | {np.median(alone):.3f} | {ratio:.3f} | {rate:.0f}"
        )
    table("evaluation of the seven-joint model | seconds | against Batch.rollout alone")
    for name in problems:
        row(
            f"{name} | {np.median(took[name]):.3f} | {np.median(took[name] / took['passive, bare']):.2f}"
        )
    took = in_turn({model: derivatives(model) for model in ("dynamic", "quasi-static")})
    table("a Jacobian of the excavator | seconds | times as fast")
    for name, seconds in took.items():
        row(
            f"{name} | {np.median(seconds):.3f} | {np.median(took['dynamic'] / seconds):.1f}"
        )
    table("joints with hydraulics | step [µs] | times real time")
    for some in ([2], ALL):
        step, period = plant_steps(some)
        row(f"{len(some)} | {1e6 * step:.0f} | {period / step:.0f}")
