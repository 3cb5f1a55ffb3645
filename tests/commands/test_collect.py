"""Runs that were made apart come together, and those that do not belong together are warnings."""

import csv
import json
import shutil
from pathlib import Path

import pytest
import yaml
from conftest import step_log
from typer.testing import CliRunner

import hydroid
from hydroid import load_settings, read_logs
from hydroid.commands.app import app
from hydroid.errors import RunError
from hydroid.log import write_log
from hydroid.prediction import simulate_log
from hydroid.reporting import drawing

SMALL = {
    "search.algorithm": "ga",
    "search.ga.population": 6,
    "search.ga.generations": 2,
    "refinement.iterations": 1,
    "objective.segments": {"equal": 2},
}
TRUTH = {"K": 0.2, "D": 231.8, "S": 53.4, "M1": 4.6, "M2": 5.1, "M3": 22.5, "M4": 1.6, "M5": 4.0, "M6": 4.7}
SEEDS = (3, 1, 2)


@pytest.fixture(scope="module")
def fitted(tmp_path_factory: pytest.TempPathFactory):
    """Three finished runs, their folder, and what `fit-mech --runs` would have had of them."""
    folder = tmp_path_factory.mktemp("array")
    settings = load_settings("article-mech", SMALL)
    log = simulate_log(settings, step_log(settings.arm.pose("study"), [60.0, -80.0]), TRUTH, "truth")
    write_log(folder / "log.csv", log, settings.log)
    results = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(drawing, "write_page", lambda *_: [])  # figures take longer than all else here
        for seed in SEEDS:
            seeded = load_settings("article-mech", SMALL | {"search.seed": seed})
            path = folder / f"seed-{seed}"
            results.append(hydroid.fit(seeded, read_logs([folder / "log.csv"], seeded), path))
    return folder, sorted(results, key=lambda result: result.problem.settings.search.seed)


@pytest.fixture
def runs(fitted, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[Path]:
    """Copies of the runs, named as from their folder."""
    monkeypatch.chdir(tmp_path)
    for seed in SEEDS:
        shutil.copytree(fitted[0] / f"seed-{seed}", tmp_path / f"seed-{seed}")
    return [Path(f"seed-{seed}") for seed in SEEDS]


def change(file: Path, **values: object) -> None:
    """Change entries of a YAML or JSON file."""
    content = yaml.safe_load(file.read_text()) | values
    file.write_text(json.dumps(content) if file.suffix == ".json" else yaml.safe_dump(content))


def collected(caplog: pytest.LogCaptureFixture, *names: object) -> tuple[list[int], list[str]]:
    """Return the seeds that were taken, and the warnings."""
    caplog.clear()
    study = hydroid.report([str(name) for name in names], merge=True, out="out")
    return [run.seed for run in study.result.runs], caplog.messages


def test_the_best_run_is_the_first_of_the_table_of_runs(fitted, runs):
    best = hydroid.report(["seed-*"], merge=True, out="out").result.best
    fits = {r.problem.settings.search.seed: r.fit for r in fitted[1]}
    order = sorted(fits, key=lambda seed: fits[seed].best.rms)
    assert best.seed == order[0]
    with Path("out/tables/runs.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [int(row["seed"]) for row in rows] == order
    values = [float(value) for name, value in rows[0].items() if name.endswith("]")][1:]
    assert values == list(fits[best.seed].best.theta)


def test_runs_that_cannot_be_used_are_named_and_left_out(runs, caplog, tmp_path: Path):
    change(Path("seed-1/run.json"), status="interrupted")
    assert collected(caplog, "seed-*") == (
        [2, 3],
        ["left out: seed-1: is not finished (interrupted); resume it"],
    )
    (tmp_path / "seed-4").mkdir()
    Path("seed-2/estimate.yaml").write_text("parameters: {K: 0.2}\n")
    seeds, warnings = collected(caplog, "seed-*", "nowhere")
    assert seeds == [3]
    assert [line.split(":")[1].split(",")[0].strip() for line in warnings] == [
        "nowhere/run.json",
        "seed-1",
        "seed-2/estimate.yaml",
        "seed-4/run.json",
    ]
    with pytest.raises(RunError, match="no finished run is there"):
        collected(caplog, "seed-1", "seed-2", "seed-4")
    with pytest.raises(RunError, match="is a run itself"):
        hydroid.report(["seed-*"], merge=True, out="seed-3")


def test_a_seed_counts_once(runs, caplog):
    shutil.copytree("seed-2", "again")
    seeds, warnings = collected(caplog, "seed-*", "again")
    assert seeds == [1, 2, 3]
    assert warnings == ["left out: seed-2: has seed 2, as again has"]


def test_runs_of_other_settings_logs_and_versions_are_not_mixed(runs, caplog, fitted, tmp_path: Path):
    from hydroid.run.folder import RunFolder

    def begun(name: str, **changes: object) -> None:
        """The run of seed 3 with the same estimate under other settings."""
        settings = load_settings("article-mech", SMALL | {"search.seed": 3} | changes)
        shutil.rmtree("seed-3")
        RunFolder(tmp_path / "seed-3").begin(settings, read_logs([fitted[0] / name], settings))
        shutil.copy(fitted[0] / "seed-3" / "estimate.yaml", "seed-3/estimate.yaml")
        RunFolder(tmp_path / "seed-3").status("done")

    def refused() -> str:
        caplog.clear()
        with pytest.raises(RunError, match="1 of 3 runs differ from seed-1 in more than the seed"):
            hydroid.report(["seed-*"], merge=True, out="out")
        assert not Path("out").exists()
        (line,) = caplog.messages
        return line

    begun("log.csv", **{"search.ga.generations": 3})
    assert refused() == "seed-3: has search.ga.generations = 3, not 2"
    lines = (fitted[0] / "log.csv").read_text().splitlines()
    (fitted[0] / "other.csv").write_text("\n".join(lines[:-1]))
    begun("other.csv")
    assert refused().startswith("seed-3: has other logs: ")
    begun("log.csv")
    change(Path("seed-3/run.json"), hydroid="0.0")
    assert refused().startswith("seed-3: was made by hydroid 0.0, not ")
    # threads change no bit
    begun("log.csv", **{"simulation.threads": 1})
    assert collected(caplog, "seed-*") == ([1, 2, 3], [])


def test_the_command_names_the_best_run_and_warns_on_the_side(runs):
    change(Path("seed-3/run.json"), status="running")
    done = CliRunner().invoke(app, ["report", "--merge", *map(str, runs), "--out", "out", "--json"])
    assert done.exit_code == 0
    found = json.loads(done.stdout)
    assert set(found["runs"]) == {"seed-1", "seed-2"}
    assert found["best"] == min(found["runs"], key=lambda run: found["runs"][run]["rms_deg"])
    assert [row["name"] for row in found["parameters"]] == [*TRUTH, "rms output error"]
    assert done.stderr == "hydroid: left out: seed-3: is not finished (running); resume it\n"
    done = CliRunner().invoke(app, ["report", "--merge", "seed-*", "--out", "out"])
    assert f"smallest error: {found['best']} (seed " in done.stdout
