"""Does `hydroid suggest` name what a model lacks, and is it silent where it lacks
nothing?

docs/measured.md says what is simulated and when a term is named. Stage 2 of the
shoulder: the parameters in `TRUTH` are free, as in configs/fit-hyd.yaml, and all else
is held at the truth.
"""

import numpy as np
from common import options, row, table, true_log
from made_logs import at_rest, noisy, simulate_log
from observation import trace
from recovery import known

from hydroid import load_settings
from hydroid.advice.suggestions import advice
from hydroid.arm.model import load_model
from hydroid.log import Log
from hydroid.problem.bindings import Bindings
from hydroid.problem.problem import Problem
from hydroid.progress import no_progress
from hydroid.settings.fit import FitSettings
from hydroid.simulation import make_simulation

TRUTH = {
    "A_A": 1000.0,
    "A_B": 750.0,
    "open_A": 0.4,
    "open_B": 0.4,
    "D": 150.0,
    "M3": 22.5,
}
TERMS = {"delay": 0.03, "overlap": 0.05, "opening_exponent": 1.1, "dry_friction": 1500.0, "flow_limit": 0.8,
         "leakage": 0.02, "none": 0.0}  # fmt: skip
"""what is present in the truth, in its unit; the flow limit is a part of the flow that
the log without it exceeds for 1 % of the time"""


def make_settings(term: str = "none", value: float = 0.0) -> FitSettings:
    """The model without any term, or the truth with one."""
    changes: dict[str, object] = {
        "refinement.gain_tolerance": 1e-6,
        "parameters.D.joints": [2],
    }
    settings = load_settings(
        "fit-hyd", changes | ({} if term == "none" else {f"hydraulics.{term}": value})
    )
    return settings.changed(
        {"parameters": {name: settings.parameters[name] for name in TRUTH}}
    )


def make_log(term: str, seconds: float, seed: int) -> Log:
    rng, rest = np.random.default_rng([seed, 17]), 100
    truth = (
        make_settings() if term == "flow_limit" else make_settings(term, TERMS[term])
    )
    pose = truth.arm.pose("study").copy()
    pose[1:3] = np.radians([rng.uniform(0, 40), rng.uniform(-100, -40)])
    drive = true_log(truth, TRUTH, seconds, seed, pose).command
    log = at_rest(pose, np.concatenate([np.zeros_like(drive[:rest]), drive[:-rest]]))
    if term == "flow_limit":
        truth = make_settings(term, TERMS[term] * largest_flow(truth, log))
    return noisy(simulate_log(truth, log, TRUTH), 0.1, rng, exact_start=False)


def largest_flow(truth: FitSettings, log: Log) -> float:
    """Flow from the pump that the true arm exceeds for 1 % of a log [L/min]."""
    simulation, stage = (
        make_simulation(load_model(truth.arm), log, [1], truth),
        Bindings(truth),
    )
    one = stage.candidates(truth.parameter_set().vector(TRUTH, "truth")[None])
    flow = trace(simulation.scenario, one).flow[:, 0]
    return 6e4 * float(np.quantile(np.maximum(flow[:, 0], -flow[:, 1]), 0.99))


def tried(term: str, k: int, seconds: float) -> tuple[bool, bool, bool, float, float]:
    """Of one log: named, first, anything named, rms on parts left out without and with
    it [deg]."""
    # seeds below 100 were used while the test was written
    problem = Problem(
        make_settings(),
        [make_log(term, seconds, 1000 * list(TERMS).index(term) + 100 + k)],
    )
    content = advice(
        problem,
        known(problem, TRUTH, np.random.default_rng([k, 5])),
        "RUN",
        no_progress,
    )[0]
    free = [row["name"] for row in content["terms"] if "command" in row]
    sides = (term, f"{term}_a", f"{term}_b")
    rows = [row for row in (content, *content["terms"]) if "left_out_deg" in row]
    without, *freed = (
        worst(row["left_out_deg"]) for row in rows if row.get("name", term) in sides
    )
    named = [name in sides for name in free]
    return any(named), any(named[:1]), bool(free), without, min(freed, default=np.nan)


def worst(left_out: dict[str, float | None]) -> float:
    """Return the largest error of a joint [deg]; infinite where a simulation
    diverged."""
    return max(np.inf if error is None else error for error in left_out.values())


if __name__ == "__main__":
    given = options(__doc__, logs=20, seconds=15.0, only=list(TERMS))
    table(
        "left out | named | first | anything named | rms left out without it [deg] | with it"
    )
    for term in given.only:
        every = np.array([tried(term, k, given.seconds) for k in range(given.logs)])
        counts = " | ".join(
            f"{n:.0f} of {given.logs}" for n in every[:, :3].sum(axis=0)
        )
        without, freed = every[:, 3], every[np.isfinite(every[:, 4]), 4]
        last = f"{np.median(freed):.3f}" if len(freed) else ""
        row(f"{term} | {counts} | {np.median(without):.3f} | {last}")
