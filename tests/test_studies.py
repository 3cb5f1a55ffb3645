"""The study's mechanism: each run is one file, what is there is not repeated, what
failed is shown."""

import json
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import psutil
import pytest
import yaml
from conftest import SMALL
from log_files import head

from hydroid import read_logs, studies
from hydroid.errors import HydroidError, RunError
from hydroid.progress import no_progress
from hydroid.settings.fit import StudySettings, cell_settings
from hydroid.settings.load import load
from hydroid.studies import Row, make_tasks, read_cells, run_study


def content(**changes: Any) -> dict[str, Any]:
    study: dict[str, Any] = {
        "title": "Two norms",
        "base": "article-mech",
        "set": SMALL | {"refinement": None},
        "logs": ["short.csv"],
        "axes": {
            "norm": {
                "largest": {"objective.norm": "inf"},
                "mean": {"objective.norm": 1},
            }
        },
        "seeds": 2,
    }
    return study | changes


def written(folder: Path, **changes: Any) -> Path:
    head(folder / "short.csv", 301)
    file = folder / "small.yaml"
    file.write_text(yaml.safe_dump(content(**changes), sort_keys=False))
    return file


def run(file: Path, out: Path) -> tuple[Row, ...]:
    with ThreadPoolExecutor(1) as executor:
        return run_study(file, out, read_logs, executor, no_progress)


def stored(folder: Path) -> dict[str, dict[str, Any]]:
    """Results by file, without the time that they took."""
    found = {
        file.name: json.loads(file.read_text())
        for file in sorted((folder / "runs").glob("*.json"))
    }
    for result in found.values():
        result.get("measures", {}).pop("seconds", None)
    return found


def test_what_is_there_is_read_and_what_is_missing_is_performed(
    tmp_path: Path, monkeypatch, caplog
):
    caplog.set_level("INFO", "hydroid")
    file = written(tmp_path)
    first, before = run(file, tmp_path), stored(tmp_path)
    assert len(first) == len(before) == 4
    assert "found" not in caplog.text
    next((tmp_path / "runs").glob("*.json")).unlink()
    performed: list[tuple[str, int]] = []
    perform = studies.perform

    def counted(task):
        performed.append((task.cell, task.seed))
        return perform(task)

    monkeypatch.setattr(studies, "perform", counted)
    again = run(file, tmp_path)
    assert len(performed) == 1
    assert "3 of 4 runs found, goes on" in caplog.text
    assert stored(tmp_path) == before
    both = zip(first, again, strict=True)
    assert all(
        a.values[n] == b.values[n] for a, b in both for n in a.values if n != "seconds"
    )
    # another study shares the runs that both have; the unused search's settings decide
    # nothing
    other = {"alone": {"one": {"objective.norm": "inf", "search.nsga2.population": 10}}}
    run(written(tmp_path, axes=other), tmp_path)
    assert set(stored(tmp_path)) == set(before)
    run(written(tmp_path, seeds=3), tmp_path)  # more seeds add runs
    assert len(stored(tmp_path)) == 6


def test_a_run_is_the_same_wherever_the_arm_s_files_lie(tmp_path: Path):
    """A checkout that is moved keeps its runs: paths decide nothing."""
    file = written(tmp_path)
    cells = cell_settings(load(file, StudySettings), file)
    logs = read_cells([tmp_path / "short.csv"], cells, read_logs)
    (task, *_) = make_tasks(cells, 1, logs)
    arm = task.settings.arm
    moved = arm.changed({"pair": tmp_path / "other.xml"})
    other = replace(task, settings=task.settings.model_copy(update={"arm": moved}))
    assert other.key() == task.key()


def test_each_cell_reads_the_logs_by_its_own_settings(tmp_path: Path):
    periods = {
        "fine": {"log.period_s": 0.01},
        "again": {"log.period_s": 0.01},
        "coarse": {"log.period_s": 0.02},
    }
    file = written(tmp_path, axes={"period": periods})
    cells = cell_settings(load(file, StudySettings), file)
    logs = read_cells([tmp_path / "short.csv"], cells, read_logs)
    found = {name: log.period for name, (log,) in logs.items()}
    assert found == {"fine": 0.01, "again": 0.01, "coarse": 0.02}
    assert logs["fine"] is logs["again"]


def test_a_run_that_fails_is_shown_and_the_others_count(tmp_path: Path, monkeypatch):
    perform = studies.perform

    def failing(task):
        if (task.cell, task.seed) == ("mean", 2):
            raise RunError("every candidate diverged")
        if (task.cell, task.seed) == ("mean", 1):
            raise MemoryError("for now")
        return perform(task)

    monkeypatch.setattr(studies, "perform", failing)
    runs = run(written(tmp_path), tmp_path)
    assert [(row.cell, row.seed, row.failed) for row in runs if row.failed] == [
        ("mean", 1, "MemoryError: for now"),
        ("mean", 2, "every candidate diverged"),
    ]
    assert [row.cell for row in runs if not row.failed] == ["largest", "largest"]
    assert len(stored(tmp_path)) == 3  # what may pass is tried again
    monkeypatch.setattr(studies, "perform", perform)
    assert [row.failed for row in run(written(tmp_path), tmp_path)].count("") == 3


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            {"axes": {"norm": {"a": {"objective.nrm": 1}}}},
            r"small.yaml: .*objective.nrm.*'norm'",
        ),
        (
            {"set": {"search.ga.population": 1}},
            r"small.yaml: search.ga.population: .*than or equal to 4",
        ),
        (
            {"axes": {"objective.norm": []}},
            r"small.yaml, line \d+: axes.objective.norm",
        ),
        ({"sedes": 3}, r"unknown setting 'sedes'; did you mean 'seeds'"),
        (
            {"base": "nowhere"},
            r"nowhere: no such config; give a YAML file or one of: .*article-mech",
        ),
        ({"logs": []}, r"small.yaml, line \d+: logs"),
        ({"logs": ["gone.csv"]}, r"gone.csv"),
    ],
)
def test_a_bad_file_is_refused_in_one_line(
    tmp_path: Path, change: dict[str, Any], message: str
):
    with pytest.raises(HydroidError, match=message) as error:
        run(written(tmp_path, **change), tmp_path)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("text", ["{", "[]", '{"other": 1}'])
def test_a_damaged_result_is_refused_in_one_line(tmp_path: Path, text: str):
    file = written(tmp_path, axes={"objective.norm": ["inf"]}, seeds=1)
    run(file, tmp_path)
    (result,) = (tmp_path / "runs").glob("*.json")
    result.write_text(text)
    with pytest.raises(RunError, match="remove it"):
        run(file, tmp_path)


def test_axes_multiply_and_lists_name_their_cells(tmp_path: Path):
    axes = {"search.ga.crossover_rate": [0.4, 0.8], "norm": content()["axes"]["norm"]}
    file = written(tmp_path, axes=axes)
    cells = cell_settings(load(file, StudySettings), file)
    names = [
        f"search.ga.crossover_rate {r}, {n}"
        for r in (0.4, 0.8)
        for n in ("largest", "mean")
    ]
    assert list(cells) == names
    assert [s.search.ga.crossover_rate for s in cells.values()] == [0.4, 0.4, 0.8, 0.8]


@pytest.mark.slow
def test_a_killed_study_goes_on_ends_with_the_same_bits_and_leaves_no_process(
    tmp_path: Path,
):
    file, (whole, killed) = (
        written(tmp_path, seeds=6),
        (tmp_path / "whole", tmp_path / "killed"),
    )

    def start(out: Path) -> "subprocess.Popen[str]":
        command = [
            sys.executable,
            "-m",
            "hydroid",
            "study",
            file,
            "--out",
            out,
            "--processes",
            "2",
        ]
        return subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )

    first, second = start(whole), start(killed)
    while not list(killed.glob("runs/*.json")) and second.poll() is None:
        time.sleep(0.01)
    workers = psutil.Process(second.pid).children()
    second.send_signal(signal.SIGKILL)
    second.wait()
    assert first.wait(timeout=300) == 0, first.communicate()
    before = {file: file.stat().st_mtime_ns for file in killed.glob("runs/*.json")}
    assert 0 < len(before) < 12
    again = start(killed)
    _, said = again.communicate(timeout=300)
    assert again.returncode == 0, said
    assert f"{len(before)} of 12 runs found, goes on" in said
    # nothing is done twice
    assert all(file.stat().st_mtime_ns == then for file, then in before.items())
    assert stored(killed) == stored(whole)
    cells = "tables/cells.csv"  # runs.csv has the seconds too
    assert (killed / cells).read_bytes() == (whole / cells).read_bytes()
    assert workers
    assert not any(worker.is_running() for worker in workers)
