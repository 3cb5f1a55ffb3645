"""Do 95 % intervals and bands hold? Fits of simulated logs whose truth is known,
counted.

docs/uncertainty.md says what `--parts` intervals, start, own_arm and bands simulate,
docs/quantities.md what quantities does, and docs/measured.md what left_out predicts.
"predicted / spread" is the mean standard deviation over the root of the mean square
error.
"""

import runpy
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
from common import EXAMPLES, Clock, options, row, table, true_log
from made_logs import FAST, HYDRAULIC, fast_arm, noisy, stepped
from recovery import bands_in, known, model_of, refined

import hydroid
from hydroid import load_settings
from hydroid.log import Log
from hydroid.posterior.bench import make_bench
from hydroid.posterior.quantities import joint_measure
from hydroid.posterior.uncertainty import Uncertainty
from hydroid.problem.problem import Problem
from hydroid.settings.fit import FitSettings

Said = tuple[np.ndarray, np.ndarray, np.ndarray]
"""values, standard deviations, and intervals, shape (m, 2)"""


def fits(
    settings: FitSettings,
    truth: Mapping[str, float],
    logs: Callable[[Any], list[Log]],
    most: int,
    *key: int,
) -> Iterator[Uncertainty]:
    """Yield what fits of new logs, made from a generator, know."""
    for seed in range(most):
        rng = np.random.default_rng([seed, *key])
        yield known(Problem(settings, logs(rng)), truth, rng)


def report(
    title: str,
    names: Sequence[str] | np.ndarray,
    truth: np.ndarray,
    said: Iterator[Said],
) -> None:
    """Print how often intervals hold the truth, shape (m,), where there are any."""
    clock = Clock()
    values, sds, intervals = (np.array(each) for each in zip(*said, strict=True))
    print(f"\n{title}, {len(values)} fits, {clock}")
    low, high = np.moveaxis(intervals, 2, 0)
    known = np.isfinite(sds) & (sds > 0)
    hits = np.where(known, (low <= truth) & (truth <= high), np.nan)
    error, sd = (
        np.sqrt(np.mean((values - truth) ** 2, axis=0)),
        np.where(known, sds, np.nan),
    )
    shown = np.any(known, axis=0)
    hits, sd, error = hits[:, shown], sd[:, shown], error[shown]
    columns = [
        np.array(names)[shown],
        truth[shown],
        100 * np.mean(known, axis=0)[shown],
    ]
    columns += [100 * np.nanmean(hits, axis=0), np.nanmean(sd, axis=0) / error]
    header = "of | true | determined | covered | predicted / spread"
    table(header, "{} | {:.4g} | {:.0f} % | {:.1f} % | {:.2f}", *columns)
    row("all", "", "", f"{100 * np.nanmean(hits):.1f} %", "")


def parameters(made: Iterator[Uncertainty], chosen: np.ndarray) -> Iterator[Said]:
    return (
        (one.theta[chosen], one.standard_deviation[chosen], one.interval[chosen])
        for one in made
    )


def intervals(given: Any, *, start: bool = False) -> None:
    how = {"free_start": start, "refinement.gain_tolerance": 1e-6}
    settings = fast_arm([2, 3], "K", "D", "S", "M2", "M6", **how)
    clean, free = true_log(settings, FAST, given.seconds), settings.parameter_set().free
    names, truth = (np.array([*part])[free] for part in (FAST, FAST.values()))
    for time in given.correlation_times:
        phi = float(np.exp(-clean.period / time)) if time else 0.0
        drawn = partial(noisy, clean, 0.1, phi=phi, exact_start=not start)
        made = fits(
            settings,
            FAST,
            lambda rng, drawn=drawn: [drawn(rng)],
            given.fits,
            int(1000 * phi),
        )
        title = f"noise of {time:g} s, logs of {given.seconds:g} s{', the start with noise' * start}"
        report(title, names, truth, parameters(made, free))


def quantities(given: Any) -> None:
    changes = {f"parameters.{name}.fixed": None for name in ("F1", "x1", "x2")}
    # the overlaps make a dead band; the article's model has none
    changes |= {
        "hydraulics.overlap_a": 0.4,
        "hydraulics.overlap_b": 0.3,
        "refinement.gain_tolerance": 1e-6,
    }
    settings = load_settings("article-hyd", changes)
    clean = true_log(settings, HYDRAULIC, given.seconds)
    candidates = Problem(settings, [clean]).bindings.candidates
    true = candidates(settings.parameter_set().vector(HYDRAULIC, "truth")[None])
    # planned at the truth once: every fit then states the same quantities
    measure = joint_measure(make_bench(settings, [clean], 2), true)
    columns, actual = zip(*measure(true), strict=True)
    labels = [
        f"{c.label}{'' if c.at is None else f' at {c.at:g}'} [{c.unit}]"
        for c in columns
    ]
    positive = np.array([column.positive for column in columns])

    def values(theta: np.ndarray) -> np.ndarray:
        return np.stack([value for _, value in measure(candidates(theta))], axis=1)

    made = fits(settings, HYDRAULIC, lambda rng: [noisy(clean, seed=rng)], given.fits)
    found = (one.posterior.propagate(values, positive) for one in made)
    said = ((one.value, one.sd, one.interval) for one in found)
    report(
        f"quantities, logs of {given.seconds:g} s",
        labels,
        np.array([v[0] for v in actual]),
        said,
    )


def own_arm(given: Any) -> None:
    folder = EXAMPLES / "urdf"
    example = runpy.run_path(str(folder / "make_example.py"))
    with tempfile.TemporaryDirectory() as place:
        machine, mine = Path(place) / "machine", Path(place) / "mine"
        hydroid.init(machine, arm=folder / "robot.urdf")
        hydroid.init(
            mine, arm=folder / "robot.urdf", log=sorted(folder.glob("log_*.csv"))
        )
        settings, truth, seeds = (
            load_settings(mine / "fit.yaml"),
            example["machine"](machine),
            count(1000),
        )
        drawn = partial(example["recorded"], truth)
        made = fits(
            settings,
            truth.values,
            lambda _: [drawn(next(seeds)), drawn(next(seeds))],
            given.fits,
        )
        true = settings.parameter_set().vector(truth.values, "truth")
        names = np.array(settings.parameter_set().names)[true > 0]
        report("own arm", names, true[true > 0], parameters(made, true > 0))


def bands(given: Any) -> None:
    settings = fast_arm([2], "K", "D", "S", free_start=True)

    def steps(values: dict[str, float], rng: np.random.Generator) -> Log:
        return noisy(
            stepped(settings, values, rng.uniform(-60.0, 60.0, 5)),
            seed=rng,
            exact_start=False,
        )

    table("the other log | inside the band, median (range) | below 80 %")
    for percent in (0, 5, 20, 50):
        found, wrong = [], FAST | {"S": (1 + percent / 100) * FAST["S"]}
        for seed in range(given.fits):
            rng = np.random.default_rng(seed)
            problem = Problem(settings, [steps(FAST, rng)])
            theta = refined(problem, problem.parameters.vector(FAST, "truth"))
            found.append(bands_in(model_of(problem, theta), steps(wrong, rng))[2])
        low, middle, high = np.quantile(
            [100 * band.inside for band in found], [0.0, 0.5, 1.0]
        )
        named = sum(band.inside < 0.8 for band in found)
        row(
            f"S {percent} % wrong",
            f"{middle:.0f} % ({low:.0f} to {high:.0f})",
            f"{named} of {given.fits}",
        )


def left_out(given: Any) -> None:
    # logs, and the samples at which they rest where a piece begins
    pieces = {"shoulder_1": (0, 2200), "shoulder_2": (0, 3300), "all_joints_1": (0,)}
    masses = load_settings("fit-hyd").arm.masses
    changes: dict[str, object] = {
        "simulation.other_joints": "measured",
        "search.nsga2.generations": 3,
    }
    changes |= {f"log.joints.{joint}.command": None for joint in (1, 3, 4, 5, 6, 7)}
    changes |= {f"parameters.M{i + 1}.fixed": float(masses[i]) for i in range(6)}
    for stage in ("hyd", "mech"):
        settings, logs = load_settings(f"fit-{stage}", changes), list[Log]()
        for name, starts in pieces.items():
            (log,) = hydroid.read_logs(
                [EXAMPLES / "logs" / f"rig_{name}.csv"], settings
            )
            for first in starts:
                part = log.part(first, first + round(given.seconds / log.period))
                logs.append(replace(part, source=f"{name} from {first}.csv", rest=None))
        model = hydroid.fit(settings, logs).model
        print(f"\nstage {stage}")
        table(
            "left out | expected [deg] | actual [deg] | actual / expected | inside the band"
        )
        for i, log in enumerate(logs):
            problem = Problem(model.settings, [*logs[:i], *logs[i + 1 :]])
            band = bands_in(model_of(problem, refined(problem, model.theta)), log)[2]
            errors = f"{np.degrees(band.expected):.3f} | {np.degrees(band.error):.3f}"
            shares = f"{band.error / band.expected:.1f} | {100 * band.inside:.0f} %"
            row(Path(log.source).stem, errors, shares)


if __name__ == "__main__":
    parts = {
        "intervals": intervals,
        "start": lambda given: intervals(given, start=True),
    }
    parts |= {each.__name__: each for each in (quantities, own_arm, bands, left_out)}
    times = {"seconds": 20.0, "correlation_times": [0.0, 0.15, 1.0, 4.0]}
    given = options(__doc__, parts=[*parts], fits=20, **times)
    for part in given.parts:
        parts[part](given)
