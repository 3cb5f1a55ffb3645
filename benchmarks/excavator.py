"""The real excavator: fitted to its twelve logs, judged on the other six, from several starts.

    python benchmarks/excavator.py [LAST | FIRST LAST] [--figure PNG]      (seeds 1 to 5)

Nothing in the shipped fit is random: seed 1 is the shipped start, and every other seed moves all start values
by half a standard deviation of their priors. Prints time, simulations and, by joint, the mean absolute error
over whole logs [deg], beside the throw-away models that were tried before. The last fit's prediction of the
first check log can be drawn.
"""

import sys
import time
from pathlib import Path

import numpy as np

import hydroid
from hydroid.fitting.refinement import refine
from hydroid.fitting.search import search
from hydroid.identified_model import IdentifiedModel
from hydroid.prediction import predict
from hydroid.problem.problem import Problem
from hydroid.search.descent import Descent
from hydroid.settings.fit import FitSettings

FOLDER = Path(__file__).parents[1] / "examples" / "excavator"
JOINTS = {2: "boom", 3: "arm", 4: "bucket", 1: "swing"}
MOVED = 0.5
"""standard deviations of its prior by which a start value is moved"""
BEFORE = {
    "a table of speeds, 24 bins per joint, with a delay": (2.1, 2.5, 8.6, 5.0),
    "dead band, power law, lag, delay, gravity per joint": (1.9, 3.2, 10.0, 4.7),
}


def starts(seed: int) -> dict[str, object]:
    """Return settings that move the start values; none for seed 1."""
    if seed == 1:
        return {}
    rng = np.random.default_rng(seed)
    moved: dict[str, object] = {}
    for p in hydroid.load_settings(FOLDER / "fit.yaml").parameter_set().parameters:
        if p.fixed is None and p.start is not None and p.prior is not None:
            # the distance between the bounds, in standard deviations
            sd = p.prior.score(np.array(p.upper)) - p.prior.score(np.array(p.lower))
            place = np.clip(p.position(p.start) + rng.normal(0, MOVED) / sd, 0.0, 1.0)
            moved[f"parameters.{p.name}.start"] = float(p.at(place))
    return moved


def errors(model: hydroid.IdentifiedModel, logs: list[hydroid.Log]) -> list[float]:
    """Mean absolute error over all logs [deg], by joint in the order of JOINTS."""
    outputs = model.settings.outputs
    found = [np.abs(log.angle[:, [j - 1 for j in outputs]] - predict(model, log, outputs)) for log in logs]
    mean = dict(zip(outputs, np.rad2deg(np.concatenate(found).mean(axis=0)), strict=True))
    return [float(mean[joint]) for joint in JOINTS]


def fitted(settings: FitSettings, logs: list[hydroid.Log]) -> tuple[IdentifiedModel, Descent, int]:
    """Fit as `hydroid.fit` does, without the uncertainty: the model, its refinement, and all simulations."""
    problem = Problem(settings, logs)
    searched = search(problem, lambda row: None, lambda simulated, rms: None, {})
    assert settings.refinement is not None
    result = refine(problem, searched.theta[0], settings.refinement, lambda simulated, rms: None)
    theta = problem.parameters.from_unit(result.point)
    return (
        IdentifiedModel(settings, theta, "a fit"),
        result,
        int(searched.history[-1, 2]) + result.evaluations,
    )


def figure(model: hydroid.IdentifiedModel, log: hydroid.Log, path: Path) -> None:
    """Draw measured and predicted angles of one log."""
    import matplotlib.pyplot as plt

    outputs = model.settings.outputs
    response = np.rad2deg(predict(model, log, outputs))
    drawing, axes = plt.subplots(4, 1, figsize=(9, 8), sharex=True, layout="constrained")
    for axis, (joint, name) in zip(axes, JOINTS.items(), strict=True):
        axis.plot(log.time, np.rad2deg(log.angle[:, joint - 1]), color="0.2", label="measured")
        axis.plot(
            log.time, response[:, outputs.index(joint)], color="C1", label="predicted from the commands"
        )
        axis.set_ylabel(f"{name} [deg]")
    axes[0].legend(loc="upper right")
    axes[-1].set_xlabel("time [s]")
    drawing.suptitle(f"{Path(log.source).name}: not used in the fit")
    drawing.savefig(path, dpi=80)


def main(first: int, last: int, picture: Path | None) -> None:
    """Fit over seeds and print the tables."""
    print(f"{'':54}" + "".join(f"{name:>9}" for name in JOINTS.values()))
    for name, row in BEFORE.items():
        print(f"{name:54}" + "".join(f"{e:9.1f}" for e in row))
    model = None
    for seed in range(first, last + 1):
        settings = hydroid.load_settings(FOLDER / "fit.yaml", starts(seed))
        logs, checks = (
            hydroid.read_logs(sorted(FOLDER.glob(f"{kind}_*.csv")), settings) for kind in ("fit", "check")
        )
        wall, cpu = time.monotonic(), time.process_time()
        model, result, simulations = fitted(settings, logs)
        spent = f"{time.monotonic() - wall:.0f} s, {time.process_time() - cpu:.0f} s of CPU"
        print(f"seed {seed}: {spent}, {simulations} simulations, {result.ending.value}")
        for kind, those in (("fit_*", logs), ("check_*", checks)):
            print(f"{'   ' + kind:54}" + "".join(f"{e:9.2f}" for e in errors(model, those)), flush=True)
        if picture is not None:
            figure(model, checks[0], picture)


if __name__ == "__main__":
    arguments = sys.argv[1:]
    target = Path(arguments.pop(arguments.index("--figure") + 1)) if "--figure" in arguments else None
    numbers = [int(a) for a in arguments if a.isdecimal()]
    main(numbers[0] if len(numbers) > 1 else 1, numbers[-1] if numbers else 5, target)
