"""What a simulation costs, and what hydroid adds to it: ratios inside one run (`make bench B=throughput`).

A population (70 candidates, 7,500 steps, objectives included) against `mujoco.batch.Batch.rollout` alone
on the same model and candidates, set up beforehand; `locked` against `passive`; stage 2 against stage 1; the
search's own share of the wall time; and how fast a plant steps, as a multiple of real time.
"""

import time
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path

import mujoco
import numpy as np
from common import row, table
from mujoco.batch import Batch

from hydroid import load_settings
from hydroid.advice.pseudo_random import pseudo_random_log
from hydroid.arm.locked import lock
from hydroid.arm.model import load_model
from hydroid.estimate import read_values
from hydroid.fitting.search import search
from hydroid.plant import load_plant
from hydroid.prediction import simulate_log
from hydroid.problem.problem import Problem

TRUTH = Path(__file__).parents[1] / "examples" / "article" / "truth.yaml"
CANDIDATES, REPEATS = 70, 9
ALL = list(range(1, 8))


def make_problem(other_joints: str, algorithm: str = "ga") -> Problem:
    changes = {"simulation.other_joints": other_joints, "search.algorithm": algorithm}
    settings = load_settings("article-mech", changes)
    log = pseudo_random_log(settings.arm.pose("study"), [2], duration=75.01)
    return Problem(settings, [simulate_log(settings, log, read_values(TRUTH)[0], str(TRUTH))])


def population(problem: Problem) -> np.ndarray:
    """Random candidates, shape (n, P)."""
    unit = np.random.default_rng(0).random((CANDIDATES, int(problem.parameters.free.sum())))
    return problem.parameters.from_unit(unit)


def bare_rollout(problem: Problem, theta: np.ndarray) -> Callable[[], object]:
    """Return MuJoCo's own rollout of the same candidates, written without hydroid's simulation."""
    log, candidates, arm = problem.logs[0], problem.bindings.candidates(theta), problem.settings.arm
    passive = problem.settings.simulation.other_joints == "passive"
    moving = np.arange(log.joints) if passive else np.array([1])
    reduced = lock(load_model(arm), arm, [arm.joint_names[j] for j in moving], log.angle[0])
    reduced.model.qpos_spring[:] = log.angle[0, moving]
    batch = Batch(reduced.model, nsim=len(theta))
    for name, value in reduced.inertials(candidates.mass).items():
        batch.expand(name)[:] = value
    batch.expand("dof_damping")[:] = candidates.joints.damping[:, moving]
    batch.expand("jnt_stiffness")[:] = candidates.joints.stiffness[:, moving]
    batch.set_const()
    steps = len(log.time) - 1
    batch.reset()
    batch.bind("qpos")[:] = log.angle[0, moving]
    bias = batch.bind("qfrc_bias")
    batch.forward()
    torque = bias[:, None] + candidates.joints.gain[:, None, moving] * log.command[:-1, moving]
    out = {"qpos": np.empty((len(theta), steps, len(moving)))}

    def roll() -> float:
        batch.reset()
        batch.bind("qpos")[:] = log.angle[0, moving]
        started = time.perf_counter()
        batch.rollout(steps, torque, mujoco.mjtState.mjSTATE_QFRC_APPLIED.value, out=out)
        return time.perf_counter() - started

    return roll


def in_turn(calls: Mapping[str, Callable[[], object]]) -> dict[str, np.ndarray]:
    """Seconds of each call in every round, shape (REPEATS,); a call may time itself."""
    rounds = dict[str, list[float]]()
    for _ in range(1 + REPEATS):  # the first one compiles and warms up
        for name, call in calls.items():
            started = time.perf_counter()
            result = call()
            took = result if isinstance(result, float) else time.perf_counter() - started
            rounds.setdefault(name, []).append(took)
    return {name: np.array(times[1:]) for name, times in rounds.items()}


def against_mujoco() -> None:
    """Print evaluation against bare rollout, and locked against passive."""
    calls: dict[str, Callable[[], object]] = {}
    for mode in ("passive", "locked"):
        problem = make_problem(mode)
        theta = population(problem)
        calls |= {mode: partial(problem.evaluate, theta), f"{mode}, bare": bare_rollout(problem, theta)}
    took = in_turn(calls)
    table("other joints | evaluation [s] | Batch.rollout alone [s] | ratio | evaluations/s")
    for mode in ("passive", "locked"):
        ours, bare = took[mode], took[f"{mode}, bare"]
        middle, ratio = np.median(ours), np.median(bare / ours)
        row(f"{mode} | {middle:.3f} | {np.median(bare):.3f} | {ratio:.3f} | {CANDIDATES / middle:.0f}")
    print(f"locked against passive: {np.median(took['passive'] / took['locked']):.2f} times the throughput")


def hydraulic_cost() -> None:
    """Print stage 2's evaluation against stage 1's on the same seven-joint model."""
    problems = {"mechanical": make_problem("passive")}
    for what, joints in (("the shoulder's hydraulics", [2]), ("all seven joints'", ALL)):
        settings = load_settings("article-hyd", {"simulation.other_joints": "passive"})
        log = pseudo_random_log(settings.arm.pose("study"), joints, duration=75.01)
        problems[what] = Problem(settings, [log])
    took = in_turn({what: partial(p.evaluate, population(p)) for what, p in problems.items()})
    ratios = [np.median(times / took["mechanical"]) for times in took.values()]
    medians = [np.median(times) for times in took.values()]
    table(
        "evaluation of the seven-joint model | seconds | ratio", "{} | {:.3f} | {:.2f}", took, medians, ratios
    )


def search_share(algorithm: str) -> float:
    """Return the share of a search's wall time [%] that is not spent in evaluating populations."""
    problem, spent = make_problem("locked", algorithm), []
    evaluate = problem.evaluate

    def timed(theta: np.ndarray) -> object:
        started = time.perf_counter()
        result = evaluate(theta)
        spent.append(time.perf_counter() - started)
        return result

    problem.evaluate = timed  # type: ignore[method-assign]
    started = time.perf_counter()
    search(problem, lambda row: None, lambda simulated, rms: None, {})
    return 100 * (1 - sum(spent) / (time.perf_counter() - started))


def plant_speed(joints: list[int], steps: int = 2000) -> None:
    """Print how long a step of a plant with hydraulics on some joints takes, at 0.01 s."""
    plant = load_plant("article-hyd", overrides={"start_pose": "study"}, joints=joints)
    commands = 30.0 * np.isin(ALL, joints) * np.sin(np.arange(steps)[:, None] / 50 + np.arange(7))

    def run() -> None:
        plant.reset()
        for command in commands:
            plant.step(command)

    step = min(in_turn({"plant": run})["plant"]) / steps
    row(f"{len(joints)} | {1e6 * step:.0f} | {plant.period / step:.0f}")


if __name__ == "__main__":
    against_mujoco()
    hydraulic_cost()
    for algorithm in ("ga", "nsga2"):
        print(f"search overhead, {algorithm}, locked: {search_share(algorithm):.2f} % of the wall time")
    table("joints with hydraulics | step [µs] | times real time")
    plant_speed([2])
    plant_speed(ALL)
