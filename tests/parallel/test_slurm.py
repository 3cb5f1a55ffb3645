"""The examples for a cluster on a real Slurm, which `.ci/slurm` starts around this
file's tests."""

import csv
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import pytest
from log_files import head

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        shutil.which("sinfo") is None or "SLURM_CONF" not in os.environ,
        reason="no Slurm here: .ci/slurm .venv/bin/pytest tests/parallel/test_slurm.py",
    ),
]
EXAMPLES = Path(__file__).parents[2] / "examples" / "cluster"
QUICK = [
    "--algorithm=ga",
    "--set=search.ga.population=6",
    "--set=refinement.iterations=2",
    "--quiet",
]
OFTEN = f"""#!{sys.executable}
from hydroid.commands.app import main
from hydroid.fitting import checkpoints
checkpoints.SAVE_EVERY = 0  # a checkpoint every generation
main()
"""
ENDED = ("COMPLETED", "FAILED", "TIMEOUT", "CANCELLED", "NODE_FAIL", "OUT_OF_MEMORY")


@pytest.fixture
def site(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with four seconds of a virtual rig's log; hydroid and dask are found as
    in an active .venv."""
    head(tmp_path / "log.csv", 400)
    monkeypatch.setenv("PATH", str(Path(sys.executable).parent), prepend=os.pathsep)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def run(*command: object) -> str:
    done = subprocess.run(
        [*map(str, command)], capture_output=True, text=True, timeout=120
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def submit(script: str, *arguments: object, options: tuple[str, ...] = ()) -> str:
    return run("sbatch", "--parsable", *options, EXAMPLES / script, *arguments).strip()


def jobs(job: str) -> list[dict[str, str]]:
    lines = run("scontrol", "--oneliner", "show", "job", job).splitlines()
    return [
        dict(word.split("=", 1) for word in line.split() if "=" in word)
        for line in lines
    ]


def wait_for(condition: Callable[[], object], seconds: float = 150) -> None:
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, told()
        time.sleep(0.2)


def told() -> str:
    return "\n".join(
        f"{file.name}: {file.read_text()}"
        for file in sorted(Path().glob("slurm-*.out"))
    )


def end_of(job: str) -> None:
    """Wait until a job, or each element of an array, has ended well."""
    wait_for(lambda: all(each["JobState"] in ENDED for each in jobs(job)))
    assert {each["JobState"] for each in jobs(job)} == {"COMPLETED"}, told()


def results(folder: str) -> dict[str, bytes]:
    """What two runs have in common that are the same."""
    names = (
        "estimate.yaml",
        "history.csv",
        "pareto.csv",
        "checkpoint.npz",
        "tables/parameters.csv",
    )
    return {name: (Path(folder) / name).read_bytes() for name in names}


def test_an_array_of_ten_seeds_is_collected(site: Path):
    job = submit("array.sbatch", "log.csv", *QUICK, "--set", "search.ga.generations=2")
    end_of(job)
    assert len(jobs(job)) == 10
    out = run(
        "hydroid",
        "report",
        "runs/array/seed-*",
        "--merge",
        "--out",
        "runs/array/merged",
        "--json",
    )
    found = json.loads(out)
    assert [run["seed"] for run in found["runs"].values()] == list(range(1, 11))
    with Path("runs/array/merged/tables/runs.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert rows[0]["run"] == found["best"]
    assert {row["run"] for row in rows} == {
        f"runs/array/seed-{seed}" for seed in range(1, 11)
    }


def test_a_requeued_run_ends_as_one_that_was_not_stopped(
    site: Path, monkeypatch: pytest.MonkeyPatch
):
    """The run is frozen until its notice comes: a long run that costs no processor
    time."""
    (site / "bin").mkdir()
    (site / "bin" / "hydroid").write_text(OFTEN)
    (site / "bin" / "hydroid").chmod(0o755)
    monkeypatch.setenv("PATH", str(site / "bin"), prepend=os.pathsep)
    options = ["log.csv", *QUICK, "--set", "search.ga.generations=150", "--seed", "3"]
    limit = ("--time=1", "--signal=B:USR1@10", "--cpus-per-task=1", "--mem=1G")
    job = submit("requeue.sbatch", "runs/long", *options, options=limit)
    printed, folder = Path(f"slurm-{job}.out"), Path("runs/long")
    frozen, met = 0, False
    deadline = time.monotonic() + 170
    while (state := jobs(job)[0])["JobState"] not in ENDED:
        assert time.monotonic() < deadline, told()
        notices = (
            printed.read_text().count("time is nearly up") if printed.exists() else 0
        )
        noticed = notices > int(state["Restarts"])
        if (
            not met
            and not frozen
            and not noticed
            and (folder / "checkpoint.npz").exists()
        ):
            with suppress(ProcessLookupError):  # that of the time before
                process = int((folder / ".lock").read_text().split()[1])
                os.kill(process, signal.SIGSTOP)
                frozen = process
        if frozen and noticed:
            os.kill(frozen, signal.SIGCONT)
            frozen, met = 0, True
        time.sleep(0.1)
    assert state["JobState"] == "COMPLETED", told()
    assert met
    assert int(state["Restarts"]) >= 1
    assert re.search("resumed from search", (folder / "run.log").read_text())
    run("hydroid", "fit-mech", *options, "--threads", "1", "--out", "runs/whole")
    assert results("runs/long") == results("runs/whole")
