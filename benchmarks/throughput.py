"""What a simulation costs, and what hydroid adds to it: ratios inside one run (`make bench B=throughput`).

A population (70 candidates, 7,500 steps, objectives included) against `mujoco.batch.Batch.rollout` alone
on the same model and candidates, set up beforehand; `locked` against `passive`; stage 2 against stage 1; the
search's own share of the wall time.
"""

import statistics
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import mujoco
import numpy as np
from mujoco.batch import Batch

from hydroid import load_settings
from hydroid.advice.pseudo_random import pseudo_random_log
from hydroid.arm.locked import lock
from hydroid.arm.model import load_model
from hydroid.estimate import read_values
from hydroid.fitting.search import search
from hydroid.prediction import simulate_log
from hydroid.problem.problem import Problem
from hydroid.settings.arm import Arm

TRUTH = Path(__file__).parents[1] / "examples" / "article" / "truth.yaml"
MEMBERS, REPEATS = 70, 9


def make_problem(other_joints: str, algorithm: str = "ga") -> tuple[Problem, Arm]:
    changes = {"simulation.other_joints": other_joints, "search.algorithm": algorithm}
    settings = load_settings("article-mech", changes)
    log = pseudo_random_log(settings.arm.pose("study"), [2], duration=75.01)
    log = simulate_log(settings, log, read_values(TRUTH)[0], str(TRUTH))
    return Problem(settings, [log]), settings.arm


def bare_rollout(problem: Problem, arm: Arm, theta: np.ndarray) -> Callable[[], object]:
    """Return MuJoCo's own rollout of the same candidates, written without hydroid's simulation."""
    log, candidates = problem.logs[0], problem.bindings.candidates(theta)
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
    applied = mujoco.mjtState.mjSTATE_QFRC_APPLIED.value

    def roll() -> object:
        batch.reset()
        batch.bind("qpos")[:] = log.angle[0, moving]
        started = time.perf_counter()
        batch.rollout(steps, torque, applied, out=out)
        return time.perf_counter() - started

    return roll


def seconds(call: Callable[[], object]) -> float:
    started = time.perf_counter()
    result = call()
    return result if isinstance(result, float) else time.perf_counter() - started


def measure(theta: np.ndarray) -> None:
    """Print evaluation against bare rollout, and locked against passive, each pair in turn."""
    calls: dict[str, tuple[Callable[[], object], Callable[[], object]]] = {}
    for mode in ("passive", "locked"):
        problem, arm = make_problem(mode)
        calls[mode] = (partial(problem.evaluate, theta), bare_rollout(problem, arm, theta))
    for pair in calls.values():  # warm up
        _ = [call() for call in pair]
    rounds = [
        {mode: [seconds(call) for call in pair] for mode, pair in calls.items()} for _ in range(REPEATS)
    ]
    print("| other joints | evaluation [s] | Batch.rollout alone [s] | ratio | evaluations/s |")
    print("| --- | --- | --- | --- | --- |")
    for mode in calls:
        ours, bare = (statistics.median(r[mode][k] for r in rounds) for k in (0, 1))
        ratio = statistics.median(r[mode][1] / r[mode][0] for r in rounds)
        print(f"| {mode} | {ours:.3f} | {bare:.3f} | {ratio:.3f} | {MEMBERS / ours:.0f} |")
    gain = statistics.median(r["passive"][0] / r["locked"][0] for r in rounds)
    print(f"locked against passive: {gain:.2f} times the throughput")


def hydraulic_cost() -> None:
    """Print stage 2's evaluation against stage 1's on the same seven-joint model, in turn."""
    mechanical, _ = make_problem("passive")
    problems = {"mechanical": mechanical}
    for what, joints in (("the shoulder's hydraulics", [2]), ("all seven joints'", list(range(1, 8)))):
        settings = load_settings("article-hyd", {"simulation.other_joints": "passive"})
        log = pseudo_random_log(settings.arm.pose("study"), joints, duration=75.01)
        problems[what] = Problem(settings, [log])
    rng = np.random.default_rng(0)
    calls = {
        what: partial(p.evaluate, p.parameters.from_unit(rng.random((MEMBERS, int(p.parameters.free.sum())))))
        for what, p in problems.items()
    }
    _ = [call() for call in calls.values()]  # compile and warm up
    rounds = [{what: seconds(call) for what, call in calls.items()} for _ in range(REPEATS)]
    print("| evaluation of the seven-joint model | seconds | ratio |")
    print("| --- | --- | --- |")
    for what in calls:
        took = statistics.median(r[what] for r in rounds)
        ratio = statistics.median(r[what] / r["mechanical"] for r in rounds)
        print(f"| {what} | {took:.3f} | {ratio:.2f} |")


def search_share(algorithm: str) -> float:
    """Return the share of a search's wall time [%] that is not spent in evaluating populations."""
    problem, _ = make_problem("locked", algorithm)
    spent = 0.0
    evaluate = problem.evaluate

    def timed(theta: np.ndarray) -> object:
        nonlocal spent
        started = time.perf_counter()
        result = evaluate(theta)
        spent += time.perf_counter() - started
        return result

    problem.evaluate = timed  # type: ignore[method-assign]
    started = time.perf_counter()
    search(problem, lambda row: None, lambda simulated, rms: None, {})
    wall = time.perf_counter() - started
    return 100 * (wall - spent) / wall


def main() -> None:
    rng = np.random.default_rng(0)
    problem, _ = make_problem("locked")
    theta = problem.parameters.from_unit(rng.random((MEMBERS, int(problem.parameters.free.sum()))))
    print(f"{MEMBERS} candidates, {len(problem.logs[0].time) - 1} steps; medians of {REPEATS} rounds")
    measure(theta)
    hydraulic_cost()
    for algorithm in ("ga", "nsga2"):
        print(f"search overhead, {algorithm}, locked: {search_share(algorithm):.2f} % of the wall time")


if __name__ == "__main__":
    main()
