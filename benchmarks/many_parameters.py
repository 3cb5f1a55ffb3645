"""27 parameters (K, D, S of each joint, six masses) from one noisy log of all joints, from far-off starts.

    python benchmarks/many_parameters.py [--starts 10] [--peer-starts 3]

The log: 60 s simulated at the article's true parameters in the study pose, every joint driven by
pseudo-random commands that keep it off its stops (so that the problem is well posed), 0.1 deg of white noise
on every angle but the first sample: the pose in which the arm stands before it moves counts as known. The
total mass is known to 0.5 kg. Starts: each parameter a factor of 0.1 to 10 off its true value, uniform in the
logarithm, which are the bounds too; then moved to where the total mass holds.

Printed for every start, hydroid's and then mujoco.sysid's: rms error, simulations, wall time, and CPU time of
all threads, which a busy machine changes less. Hydroid's is a complete fit of one start: search, refinement,
intervals. Then how many starts reached the optimum, and the intervals of the best. mujoco.sysid needs its
extra: pip install 'mujoco[sysid]'.
"""

import argparse
import time

import numpy as np
from scipy.stats import norm
from sysid_peer import Peer

from hydroid import load_settings
from hydroid.advice.pseudo_random import pseudo_random_log
from hydroid.fitting.fit import Fit, fit
from hydroid.log import Log
from hydroid.posterior.flags import WEAK_ABOVE
from hydroid.prediction import simulate_log
from hydroid.problem.problem import Problem
from hydroid.settings.arm import Arm
from hydroid.settings.fit import FitSettings

JOINTS = range(1, 8)
MASSES = {"M1": 4.6, "M2": 5.1, "M3": 22.5, "M4": 1.6, "M5": 4.0, "M6": 4.7}
TRUTH = {
    f"{name}{j}": value for name, value in (("K", 0.2), ("D", 231.8), ("S", 53.4)) for j in JOINTS
} | MASSES
QUANTITIES = {"K": "gain", "D": "damping", "S": "stiffness"}
FACTOR = 10.0
NOISE = np.deg2rad(0.1)
MARGIN = np.deg2rad(5.0)
REACHED = 0.01
"""of the lowest cost: what is no further above it has reached the optimum"""


def make_settings(seed: int) -> tuple[FitSettings, Arm]:
    """Settings of one start."""
    bounds = {name: [value / FACTOR, value * FACTOR] for name, value in TRUTH.items()}
    parameters = {
        name: {"quantity": "mass", "link": f"link{name[1:]}", "bounds": limits}
        if name in MASSES
        else {"quantity": QUANTITIES[name[0]], "joints": [int(name[1:])], "bounds": limits}
        for name, limits in bounds.items()
    }
    known = {"total mass": {"of": list(MASSES), "value": sum(MASSES.values()), "sd": 0.5}}
    changes = {
        "outputs": list(JOINTS),
        "parameters": parameters,
        "priors": known,
        "objective": {"norm": 2, "segments": {"equal": 1}},
        "search": {"algorithm": "multistart", "seed": seed, "multistart": {"starts": 1}},
    }
    settings = load_settings("article-mech", changes)
    return settings, settings.arm


def make_log(duration: float) -> Log:
    """A log of all joints, as the docstring of this file has it."""
    settings, arm = make_settings(1)

    def off_the_stops(log: Log) -> bool:
        angle = simulate_log(settings, log, TRUTH, "truth").angle
        return bool(np.all((angle > arm.lower + MARGIN) & (angle < arm.upper - MARGIN)))

    commands = pseudo_random_log(arm.pose("study"), list(JOINTS), duration, allowed=off_the_stops)
    log = simulate_log(settings, commands, TRUTH, "truth")
    log.angle[1:] += np.random.default_rng(1).normal(0.0, NOISE, log.angle[1:].shape)
    return log


class Clock:
    """Wall and CPU time from here to `stop` [s]."""

    def __init__(self) -> None:
        self._begun = time.perf_counter(), time.process_time()

    def stop(self) -> "Clock":
        """Keep the times that have passed."""
        self.wall, self.cpu = time.perf_counter() - self._begun[0], time.process_time() - self._begun[1]
        return self

    def __str__(self) -> str:
        return f"{self.wall:.0f} | {self.cpu:.0f}"


class Table:
    """Rows of starts: rms error [deg], simulations, seconds; what they found."""

    def __init__(self, problem: Problem) -> None:
        self._problem = problem
        self.found: list[np.ndarray] = []
        self.cost: list[float] = []
        self.seconds: list[float] = []

    def add(self, who: str, seed: int, theta: np.ndarray, simulated: int, clock: "Clock") -> None:
        """Print a row."""
        rows = self._problem.residuals(theta[None])
        scores = self._problem.priors.scores(theta[None])[0]
        cost = float(np.sum((rows / NOISE) ** 2) + np.sum(scores**2))
        self.found.append(theta)
        self.cost.append(cost)
        self.seconds.append(clock.wall)
        rms = np.rad2deg(float(self._problem.rms(rows)[0]))
        print(f"| {who} | {seed} | {rms:.5g} | {simulated} | {clock} |", flush=True)


def show(who: str, table: Table, best: Fit, lowest: float) -> None:
    """Print how many starts reached the optimum, how near, and the median time."""
    free, scale = best.uncertainty.free, best.uncertainty.jacobian.scale
    moved = [(best.uncertainty.root @ ((t - best.best.theta) / scale)[free]) for t in table.found]
    away = [float(np.linalg.norm(m)) for m in moved]
    reached = [c <= (1 + REACHED) * lowest for c in table.cost]
    farthest = max((a for a, r in zip(away, reached, strict=True) if r), default=np.nan)
    print(
        f"{who}: {sum(reached)} of {len(reached)} reached the optimum (cost within {REACHED:.0%} of the "
        f"lowest), these at most {farthest:.2g} standard deviations from the best; "
        f"median wall time {np.median(table.seconds):.0f} s"
    )


def show_intervals(problem: Problem, best: Fit) -> None:
    """Print each parameter's interval, and how many hold the truth."""
    told, truth = best.uncertainty, problem.parameters.vector(TRUTH, "truth")
    print("\n| parameter | truth | estimate | 95 % interval | inside | flags |")
    print("| --- | --- | --- | --- | --- | --- |")
    inside = (told.interval[:, 0] <= truth) & (truth <= told.interval[:, 1])
    for i, name in enumerate(problem.parameters.names):
        low, high = told.interval[i]
        print(
            f"| {name} | {truth[i]:g} | {told.theta[i]:.4g} | {low:.4g} to {high:.4g} | "
            f"{'yes' if inside[i] else 'NO'} | {told.status[i].flag.value} |"
        )
    for what, chosen in (
        (f"determined to {WEAK_ABOVE:.0%}", told.relative <= WEAK_ABOVE),
        ("with an interval", np.isfinite(told.interval).all(axis=1)),
    ):
        count = int(chosen.sum())
        away = np.abs(told.theta - truth)[chosen] / told.standard_deviation[chosen]
        # a 95 % interval misses one in twenty: all at once they hold with the intervals of Bonferroni
        together = int(np.sum(away <= norm.ppf(1 - 0.025 / count)))
        print(
            f"{count} {what}: {int(inside[chosen].sum())} within the 95 % interval (expected "
            f"{0.95 * count:.1f}), "
            f"{together} within the interval that holds all {count} at once with 95 %"
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--starts", type=int, default=10)
    parser.add_argument("--peer-starts", type=int, default=3)
    parser.add_argument("--duration", type=float, default=60.0)
    arguments = parser.parse_args()
    settings, arm = make_settings(1)
    log = make_log(arguments.duration)
    problem = Problem(settings, [log])
    at_truth = problem.rms(problem.residuals(problem.parameters.vector(TRUTH, "truth")[None]))[0]
    print(f"rms error at the true parameters: {np.rad2deg(at_truth):.5g} deg")
    print("| program | start | rms [deg] | simulations | wall [s] | CPU [s] |")
    print("| --- | --- | --- | --- | --- | --- |", flush=True)
    ours, theirs, fits = Table(problem), Table(problem), list[Fit]()
    for seed in range(1, arguments.starts + 1):
        settings, _ = make_settings(seed)
        clock = Clock()
        result = fit(Problem(settings, [log]))
        clock.stop()
        assert result.refinement is not None
        simulated = int(result.history[-1, 2]) + result.refinement.evaluations
        ours.add("hydroid", seed, result.best.theta, simulated, clock)
        fits.append(result)
    for seed in range(1, arguments.peer_starts + 1):
        peer = Peer(arm, problem, log, NOISE)
        unit = np.random.default_rng([seed, 0]).random((1, len(problem.parameters.names)))
        start = problem.theta(unit)[0]
        clock = Clock()
        try:
            found = peer.fit(start)
        except Exception as error:  # what its user would see
            fault = f"{type(error).__name__}: {error}"
            print(f"| mujoco.sysid | {seed} | {fault} | {peer.rollouts} | {clock.stop()} |", flush=True)
            continue
        theirs.add("mujoco.sysid", seed, found, peer.rollouts, clock.stop())
    best = fits[int(np.argmin(ours.cost))]
    lowest = min(ours.cost + theirs.cost)
    show("hydroid", ours, best, lowest)
    if theirs.cost:
        show("mujoco.sysid", theirs, best, lowest)
    show_intervals(problem, best)


if __name__ == "__main__":
    main()
