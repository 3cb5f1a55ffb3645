"""What `hydroid suggest` says, followed: does the model that it names predict an unseen
log better?

It is asked of a machine's complete fit, which lacks nothing, and of one whose settings
lack a term that the complete fit has found.
"""

import json
import shlex
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

from numpy.random import Generator

import hydroid
from hydroid.run.record import FinishedRun, load_record

LEAVABLE = ("pilot", "lag", "slope", "bend", "compensation", "D")
"""parameters of a joint in the settings that `hydroid init` writes; one that is not
there is 0"""
CLEAR = 3.0
"""standard deviations from 0 beyond which a complete fit has found a term"""


@dataclass(frozen=True)
class Followed:
    """Unseen rms errors by joint [deg] before and after the first term of `named` was
    freed.

    left_out: what the settings lack; empty: nothing. The errors after are those before
    if nothing is named, NaN if it diverged.
    """

    left_out: str
    named: list[str]
    before: list[float]
    after: list[float]


def followed(folder: Path, rng: Generator) -> Iterator[Followed]:
    """Yield a machine with a random term left out, where there is one, and the complete
    one.

    What was found is kept in the folder, and taken from there; a run that was stopped
    is resumed.
    """
    runs = folder / "mine" / "runs"
    candidates = clear_terms(load_record(runs / "fit"))
    left_out = str(rng.choice(candidates)) if candidates else ""
    for term in dict.fromkeys((left_out, "")):
        store = folder / f"followed_{term or 'complete'}.json"
        if not store.is_file():
            fit = fit_without(folder, term) if term else runs / "fit"
            store.write_text(json.dumps(asdict(follow(folder, fit, term))))
        yield Followed(**json.loads(store.read_text()))


def clear_terms(complete: FinishedRun) -> list[str]:
    """Names of the terms that a complete fit has found."""
    estimate = complete.summary.estimate
    every = [f"{kind}_{joint.name}" for joint in complete.verdict for kind in LEAVABLE]
    found = [(name, estimate[name]) for name in every if name in estimate]
    return [
        name
        for name, one in found
        if one.sd is not None and abs(one.value) > CLEAR * one.sd
    ]


def fit_without(folder: Path, term: str) -> Path:
    """Fit a machine whose settings lack a term, and return the run."""
    mine, out = folder / "mine", folder / "mine" / "runs" / "without"
    fitted = sorted(folder.glob("log_*.csv"))[:-1]
    lines = (mine / "fit.yaml").read_text().splitlines(keepends=True)
    config = mine / "without.yaml"
    config.write_text(
        "".join(line for line in lines if not line.startswith(f"  {term}: "))
    )
    hydroid.fit_hyd(fitted, config=config, out=out, resume=True)
    return out


def follow(folder: Path, fit: Path, left_out: str) -> Followed:
    """Run the first command that `hydroid suggest` prints about a run."""
    terms = [
        term for term in hydroid.suggest(fit=fit).plain()["terms"] if "command" in term
    ]
    before = unseen_deg(folder, fit)
    if not terms:
        return Followed(left_out, [], before, before)
    words = shlex.split(terms[0]["command"])
    out = Path(words[-1])
    subprocess.run([sys.executable, "-m", *words, "--resume", "--quiet"], check=True)
    return Followed(
        left_out, [term["name"] for term in terms], before, unseen_deg(folder, out)
    )


def unseen_deg(folder: Path, run: Path) -> list[float]:
    """Rms errors of a run on the machine's last log by joint [deg]; NaN if it
    diverged."""
    unseen = sorted(folder.glob("log_*.csv"))[-1]
    hydroid.validate(
        [unseen], fit=run, out=folder / "mine" / "runs" / f"validation_of_{run.name}"
    )
    verdict = load_record(run).verdict
    assert all(one.unseen_logs for one in verdict), f"{run} has no validation"
    return [
        float("nan") if one.unseen_deg is None else one.unseen_deg for one in verdict
    ]
