"""Forty machines that hydroid has not seen, through the commands that `hydroid init`
prints.

Every machine is random, with equations and an integrator of its own (stranger.py). Two
logs are fitted, and the third is predicted. The floor is what the true machine errs by
there under the logged commands; an error is judged by its ratio to the floor. Good is
an rms error on every joint of at most twice the noise plus 2 % of its travel; a joint
that is not good must be named by the verdict, whose baselines stand beside the fit.
Terms (y) are a pump, oil, and of each joint a lag before the dead band.

--exact N: also fits the own equations of the first N of these machines, from the truth
(exact_fit.py). --follow N: also leaves a term out of the first N, and follows what
`hydroid suggest` says (followed.py). --odd: the machines have valves that no exponent
describes, some off centre, some on or off, speeds that lag, and pumps that hold their
pressure up to a flow or stand on open centres. --worlds --machines 12: the arms of
tests/helpers/worlds.py instead, which have no floor. --stored fits nothing again: it
takes what lies in --folder, of the same --seed. So machines can be run in parts, by
--first, and be printed together.
"""

import json
import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from subprocess import CalledProcessError
from typing import Any

import numpy as np
from common import SPENT, Clock, options, row, table
from exact_fit import exact_fit, respond
from followed import Followed, followed
from stranger import (
    Machine,
    errors,
    floor,
    read_recording,
    rms_deg,
    urdf,
    write_machine,
)
from worlds import NOISE_DEG, NOISE_M, WORLDS, write_log

import hydroid
from hydroid.arrays import Array
from hydroid.fitting.baselines import NAMES as BASELINES
from hydroid.joint_verdict import Verdict
from hydroid.log import Log
from hydroid.run.record import load_record

RUNGS = (*BASELINES, "the fit")
# in `Machine.terms`
TERMS = {"pump": slice(1), "oil": slice(1, 2), "early lags": slice(2, None)}
FALLS, RISES, NOTHING = "falls", "rises", "nothing named"


@dataclass(frozen=True)
class Case:
    """A machine in its folder; good errors by joint [deg], (J,). One of the world's
    arms has no `machine`."""

    name: str
    folder: Path
    good: Array
    machine: Machine | None = None


class Ending:
    """What the commands left in a machine's folder.

    tested: joints that the unseen log drives; of the others nothing is judged, (J,).
    errors: unseen rms errors of each of RUNGS [deg], (4, J). inside: share of the
    unseen samples inside the bands [%], (J,). unseen: the log, as hydroid reads it.
    blamed: joints that the verdict does not call predicted, from 1. kept: name of the
    estimate. terms: as `Machine.terms`; the larger lag counts. seconds: wall and CPU
    time.
    """

    def __init__(self, folder: Path) -> None:
        record = load_record(folder / "mine" / "runs" / "fit")
        rows = [
            one.baselines_deg | {RUNGS[-1]: one.unseen_deg} for one in record.verdict
        ]
        self.tested = np.array([one.unseen_logs > 0 for one in record.verdict])
        self.errors = np.array(
            [[one.get(rung) for one in rows] for rung in RUNGS], float
        )
        self.inside = np.array([one.inside_percent for one in record.verdict], float)
        (prediction,) = record.validations.values()
        self.unseen: Log = prediction.log
        self.blamed = [
            one.joint for one in record.verdict if one.verdict is not Verdict.PREDICTS
        ]
        self.kept, values = str(record.summary.final), record.summary.values
        early = [
            values.get(f"pilot_{v.name}", 0) > values.get(f"lag_{v.name}", 0)
            for v in record.verdict
        ]
        self.terms = np.array(
            ["pump" in self.kept, "oil" in self.kept or "dynamic" in self.kept, *early]
        )
        self.seconds = np.loadtxt(folder / "seconds.txt")


@dataclass(frozen=True)
class Found:
    """A machine with what the commands left; its floor [deg], (J,), is NaN where there
    is none."""

    case: Case
    end: Ending
    floor: Array

    @property
    def ratio(self) -> Array:
        """Unseen error over the floor by joint, (J,); infinite where the fit diverged,
        NaN where nothing was tested."""
        error = np.nan_to_num(self.end.errors[-1], nan=np.inf)
        return np.where(self.end.tested, error / self.floor, np.nan)

    @property
    def within(self) -> Any:
        """Whether each of RUNGS is good on each joint, (4, J); no error that is NaN is:
        it diverged. What was not tested is no fault."""
        return (self.end.errors <= self.case.good) | ~self.end.tested

    @property
    def silent(self) -> bool:
        """Whether a joint is not good, and the verdict does not name it."""
        missed = 1 + np.flatnonzero(~self.within[-1])
        return not {*missed.tolist()} <= {*self.end.blamed}


def run_commands(folder: Path, robot: Path) -> None:
    """Run what `hydroid init` prints, the last log unseen, and note wall and CPU time
    [s]."""
    mine, clock, logs = folder / "mine", Clock(), sorted(folder.glob("log_*.csv"))
    hydroid.init(mine, arm=robot, log=[*logs])
    hydroid.fit_hyd(logs[:-1], config=mine / "fit.yaml", out=mine / "runs" / "fit")
    hydroid.validate(
        logs[-1:], fit=mine / "runs" / "fit", out=mine / "runs" / "validation"
    )
    np.savetxt(folder / "seconds.txt", clock.seconds)


def stranger(seed: int, number: int, folder: Path, *, odd: bool, stored: bool) -> Case:
    """Run a random machine."""
    rng = np.random.default_rng([seed, number])
    oddities = np.random.default_rng([seed, number, 2]) if odd else None
    machine = Machine(rng, number, oddities)
    if not stored:
        write_machine(folder, machine, rng)
        run_commands(folder, folder / "robot.urdf")
    assert (folder / "robot.urdf").read_text() == urdf(machine), (
        "it is of another --seed"
    )
    travel = np.ptp(np.degrees(read_recording(folder / "log_3.csv").angle), axis=0)
    return Case(
        str(number), folder, 2 * np.degrees(machine.noise) + 0.02 * travel, machine
    )


def world(number: int, folder: Path, *, stored: bool) -> Case:
    """Run one of the twelve arms as the world has them; errors are good up to twice the
    noise."""
    name, one = [*WORLDS.items()][number]
    if not stored:
        folder.mkdir(parents=True)
        for k in (1, 2):
            write_log(one, folder / f"log_{k}.csv", 60.0, k)
        run_commands(folder, one.write(one, folder))
    noise = [np.degrees(NOISE_M) if j == "telescope" else NOISE_DEG for j in one.joints]
    return Case(name, folder, 2 * np.array(noise))


def run(given: Any, number: int) -> Found:
    """Run a machine, or take it from its folder, and judge it."""
    folder = Path(given.folder) / f"{number:02d}"
    if not given.stored:
        shutil.rmtree(folder, ignore_errors=True)
    if given.worlds:
        case = world(number, folder, stored=given.stored)
    else:
        case = stranger(given.seed, number, folder, odd=given.odd, stored=given.stored)
    end = Ending(folder)
    if case.machine is None:
        return Found(case, end, np.full(len(case.good), np.nan))
    log, recording = end.unseen, read_recording(folder / "log_3.csv")
    return Found(case, end, floor(case.machine, recording, log.time, log.angle))


def figures(values: Array) -> str:
    return " ".join(f"{value:.2f}" for value in values)


def show(one: Found) -> None:
    """Print a machine's row."""
    end, machine = one.end, one.case.machine
    terms = [] if machine is None else [machine.terms, end.terms]
    shown = ", ".join("".join(np.where(of, "y", "-")) for of in terms)
    floors = ("", "") if machine is None else (figures(one.floor), figures(one.ratio))
    cells = (
        *map(figures, end.errors),
        *floors,
        figures(one.case.good),
        end.blamed or "",
        end.kept,
        shown,
    )
    inside = " ".join(f"{part:.0f}" for part in end.inside)
    row(one.case.name, *cells, inside, SPENT.format(*end.seconds))


def show_totals(found: Sequence[Found], machines: int) -> None:
    """Print what all machines have in common; those that were refused are not good."""
    print()
    if known := [one for one in found if one.case.machine is not None]:
        show_ratio(
            "unseen error over the floor", np.concatenate([one.ratio for one in known])
        )
        show_terms(known)
    show_inside(found)
    print(
        f"{sum(one.silent for one in found)} with a missed joint that the verdict does not name"
    )
    good = np.sum([one.within.all(axis=1) for one in found], axis=0)
    rungs = ", ".join(
        f"{rung} {count}" for rung, count in zip(RUNGS, good, strict=True)
    )
    middle = SPENT.format(*np.median([one.end.seconds for one in found], axis=0))
    print(
        f"good of {machines}: {rungs}; refused {machines - len(found)}; median time {middle}"
    )


def show_terms(found: Sequence[Found]) -> None:
    """Print how many terms of random machines were found, missed, and added where there
    is none."""
    for what, part in TERMS.items():
        true = np.concatenate(
            [one.case.machine.terms[part] for one in found if one.case.machine]
        )
        kept = np.concatenate([one.end.terms[part] for one in found])
        counts = np.sum([true & kept, true & ~kept, kept & ~true], axis=1)
        print(
            "{}: {} found, {} missed, {} added where there is none ({})".format(
                what, *counts, len(true)
            )
        )


def show_inside(found: Sequence[Found]) -> None:
    """Print the share of all unseen samples that the bands hold; a fit that diverged
    has none."""
    inside = np.concatenate([one.end.inside for one in found])
    samples = np.concatenate(
        [np.full(len(one.end.inside), len(one.end.unseen.time)) for one in found]
    )
    banded = np.isfinite(inside)
    if banded.any():
        share = np.average(inside[banded], weights=samples[banded])
        print(f"inside the 95 % bands: {share:.1f} % of the unseen samples")


def show_ratio(what: str, ratio: Array) -> None:
    ratio = ratio[~np.isnan(ratio)]
    # an infinite one allows no mean of two
    high = np.quantile(ratio, 0.9, method="higher")
    print(
        f"{what}: median {np.median(ratio):.2f}, 90th percentile {high:.2f} ({len(ratio)} joints)"
    )


def show_exact(found: Sequence[Found]) -> None:
    """Print what exact estimators leave of the unseen logs, beside the fit."""
    table(
        "machine | floor | exact, unseen | the fit, unseen | exact over the floor | the fit over it | CPU"
    )
    ratios = list[Array]()
    for one in found:
        exact, seconds = exact_errors(one)
        ratios.append(exact / one.floor)
        columns = one.floor, exact, one.end.errors[-1], ratios[-1], one.ratio
        row(one.case.name, *map(figures, columns), f"{seconds:.0f} s")
    print()
    show_ratio("exact estimators over the floor", np.concatenate(ratios))
    show_ratio(
        "the fits of these machines over it",
        np.concatenate([one.ratio for one in found]),
    )


def exact_errors(one: Found) -> tuple[Array, float]:
    """Unseen rms errors of an exact estimator [deg], (J,), and its CPU time [s]; kept
    in the folder."""
    store, truth = one.case.folder / "exact.json", one.case.machine
    assert truth is not None
    if not store.is_file():
        clock = Clock()
        *fitted, unseen = map(read_recording, sorted(one.case.folder.glob("log_*.csv")))
        angles = respond(exact_fit(truth, fitted), unseen)
        error = rms_deg(errors(angles, one.end.unseen.time, one.end.unseen.angle))
        store.write_text(json.dumps([error.tolist(), clock.seconds[1]]))
    error, seconds = json.loads(store.read_text())
    return np.array(error), seconds


def show_followed(found: Sequence[Found], seed: int) -> None:
    """Print what became of the unseen errors where `hydroid suggest` was followed."""
    table(
        "machine | left out | named | unseen, complete | before | after | over the floor | unseen error"
    )
    words = {"a term left out": list[str](), "nothing left out": list[str]()}
    for one in found:
        rng = np.random.default_rng([seed, int(one.case.name), 1])
        try:
            for case in followed(one.case.folder, rng):
                word = show_case(one, case)
                words[
                    "a term left out" if case.left_out else "nothing left out"
                ].append(word)
        except (hydroid.HydroidError, CalledProcessError) as error:
            row(one.case.name, f"refused: {error}", *[""] * 6)
    print()
    for what, every in words.items():
        counts = ", ".join(
            f"{word} {every.count(word)}" for word in (FALLS, RISES, NOTHING)
        )
        print(f"{what}, of {len(every)}: {counts}")


def show_case(one: Found, case: Followed) -> str:
    """Print a row, and return what became of the unseen error: of its ratio to the
    floor, rms over joints."""
    before, after = np.array(case.before), np.array(case.after)
    worth = [np.sqrt(np.mean((error / one.floor) ** 2)) for error in (before, after)]
    if not case.named:
        word = NOTHING
    else:
        # a fit that diverged has no error
        old, new = np.nan_to_num(worth, nan=np.inf)
        word = FALLS if new < old else RISES
    change = "{:.2f} to {:.2f}".format(*worth)
    errors = map(figures, (one.end.errors[-1], before, after))
    row(one.case.name, case.left_out, " ".join(case.named), *errors, change, word)
    return word


def main() -> None:
    numbers = {"machines": 40, "first": 0, "seed": 1, "exact": 0, "follow": 0}
    given = options(
        __doc__,
        **numbers,
        odd=False,
        worlds=False,
        stored=False,
        folder="build/strangers",
    )
    if given.worlds and (given.exact or given.follow):
        raise SystemExit("--exact and --follow are of random machines, not of --worlds")
    rungs = " | ".join(RUNGS)
    judged = "floor | ratio | good at most | named joints | kept | terms, true and kept | inside [%] | time"
    table(f"machine | {rungs} | {judged}")
    found = list[Found]()
    for number in range(given.first, given.first + given.machines):
        try:
            found.append(run(given, number))
        except (hydroid.HydroidError, FileNotFoundError) as error:
            row(number, f"refused: {error}", *[""] * (len(RUNGS) + 7))
        else:
            show(found[-1])
    if not found:
        return
    show_totals(found, given.machines)
    if given.exact:
        show_exact(found[: given.exact])
    if given.follow:
        show_followed(found[: given.follow], given.seed)


if __name__ == "__main__":
    main()
