"""Runs that were made apart come together, and those that do not belong together are told."""

import csv
import json
import shutil
from pathlib import Path

import numpy as np
import pytest
import yaml
from conftest import step_log
from typer.testing import CliRunner

from hydroid import jobs
from hydroid.cli.app import app
from hydroid.collect import collect
from hydroid.errors import RunError
from hydroid.jobs import fit_logs, load_settings
from hydroid.log import write_log
from hydroid.report.page import write_page
from hydroid.report.spread import final_spread, run_result, spread_page
from hydroid.simulating import simulate_log

SMALL = {
    "search.algorithm": "ga",
    "search.ga.population": 6,
    "search.ga.generations": 2,
    "refinement.iterations": 1,
    "objective.segments": {"equal": 2},
}
TRUTH = {"K": 0.2, "D": 231.8, "S": 53.4, "M1": 4.6, "M2": 5.1, "M3": 22.5, "M4": 1.6, "M5": 4.0, "M6": 4.7}
SEEDS = (3, 1, 2)


class Quiet:
    def generation(self, row: np.ndarray) -> None:
        pass

    def refining(self, simulated: int) -> None:
        pass


@pytest.fixture(scope="module")
def fitted(tmp_path_factory: pytest.TempPathFactory):
    """Three finished runs, their folder, and what `fit-mech --runs` would have had of them."""
    folder = tmp_path_factory.mktemp("array")
    settings = load_settings("article-mech", SMALL)
    log = simulate_log(settings, step_log(settings.arm.pose("study"), [60.0, -80.0]), TRUTH, "truth")
    write_log(folder / "log.csv", log, settings.log)
    results = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(jobs, "write_page", lambda *_: [])  # figures take longer than all else here
        for seed in SEEDS:
            seeded = load_settings("article-mech", SMALL | {"search.seed": seed})
            path = folder / f"seed-{seed}"
            results.append(
                (seed, *fit_logs(seeded, [folder / "log.csv"], path, Quiet(), lambda finding: None))
            )
    return folder, sorted(results, key=lambda result: result[0])


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
    file.write_text(json.dumps(content))


def collected(*names: object) -> tuple[list[int], list[str]]:
    """Seeds that were taken, and what was told."""
    told: list[str] = []
    found = collect([str(name) for name in names], Path("out"), told.append)
    return [run.seed for run in found.runs], told


def test_collected_runs_make_the_tables_of_runs_made_together(fitted, runs, tmp_path: Path):
    found = collect([str(path) for path in runs], tmp_path / "out", pytest.fail)
    names = fitted[1][0][1].parameters.names
    fits = [run_result(Path(f"seed-{seed}"), seed, fit, names) for seed, _, fit in fitted[1]]
    page = spread_page(fitted[1][0][1].parameters, fits)
    write_page(page, tmp_path / "together")
    together = final_spread(page)
    assert found.table.header == together.header
    for ours, theirs in zip(found.table.rows, together.rows, strict=True):
        assert [c for c in ours if isinstance(c, str)] == [c for c in theirs if isinstance(c, str)]
        numbers = [[c for c in row if isinstance(c, float)] for row in (ours, theirs)]
        np.testing.assert_allclose(*numbers, rtol=1e-12)  # deg and back
    files = [{p.relative_to(d) for p in d.rglob("*.*")} for d in (tmp_path / "out", tmp_path / "together")]
    assert files[0] == files[1]


def test_the_best_run_is_the_first_of_the_table_of_runs(fitted, runs):
    found = collect(["seed-*"], Path("out"), pytest.fail)
    errors = {seed: fit.best.rms for seed, _, fit in fitted[1]}
    assert found.best.seed == min(errors, key=errors.__getitem__)
    with Path("out/tables/runs.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [int(row["seed"]) for row in rows] == sorted(errors, key=errors.__getitem__)
    best = fitted[1][[seed for seed, _, _ in fitted[1]].index(found.best.seed)]
    values = [float(value) for name, value in rows[0].items() if name.endswith("]")][1:]
    assert values == list(best[2].best.theta)


def test_order_and_repetition_of_names_do_not_matter(runs):
    collect(["seed-1", "seed-2", "seed-3"], Path("a"), pytest.fail)
    collect(["seed-3", "seed-*", str(runs[0].resolve()), "seed-1/"], Path("b"), pytest.fail)
    for file in Path("a").rglob("*.*"):
        other = Path("b") / file.relative_to("a")
        assert other.read_bytes().replace(str(Path.cwd()).encode() + b"/", b"") == file.read_bytes()


def test_a_name_that_exists_is_no_pattern(runs):
    shutil.move("seed-2", "seed-[1]")
    assert collected("seed-[1]", "seed-3") == ([2, 3], [])


def test_runs_that_cannot_be_used_are_told_and_left_out(runs, tmp_path: Path):
    change(Path("seed-1/run.json"), status="interrupted")
    assert collected("seed-*") == (
        [2, 3],
        ["left out: seed-1: is not finished (interrupted); finish it with --resume"],
    )
    (tmp_path / "seed-4").mkdir()
    Path("seed-2/estimate.yaml").write_text("parameters: {K: 0.2}\n")
    seeds, told = collected("seed-*", "nowhere")
    assert seeds == [3]
    assert [line.split(":")[1].strip() for line in told] == [
        "nowhere/run.json",
        "seed-1",
        "seed-2/estimate.yaml",
        "seed-4/run.json",
    ]
    with pytest.raises(RunError, match="no finished run is there"):
        collected("seed-1", "seed-2", "seed-4")


@pytest.mark.parametrize(
    "damage",
    [
        {"estimates": {}},
        {"estimates": {"best": {"rms_deg": float("nan"), "values": TRUTH}}, "final": "best"},
        {"estimates": {"best": {"rms_deg": -1.0, "values": TRUTH}}, "final": "best"},
        {"estimates": {"best": {"rms_deg": None, "values": TRUTH}}, "final": "best"},
        {"estimates": {"best": {"rms_deg": 1.0, "values": TRUTH | {"K": "x"}}}, "final": "best"},
        {"estimates": [1], "final": 0},
        {"estimates": {"best": {"rms_deg": 10**400, "values": TRUTH}}, "final": "best"},
        {"final": ["best"]},
        {"estimate": None},
    ],
)
def test_a_damaged_estimate_is_left_out(runs, damage: dict[str, object]):
    file = Path("seed-2/estimate.yaml")
    file.write_text(yaml.safe_dump(yaml.safe_load(file.read_text()) | damage))
    seeds, (told,) = collected("seed-*")
    assert seeds == [1, 3]
    assert told.startswith("left out: seed-2/estimate.yaml")


def test_settings_that_were_changed_afterwards_are_told(runs):
    with Path("seed-2/config.yaml").open("a") as file:
        file.write("# mine\n")
    seeds, told = collected("seed-*")
    assert seeds == [1, 3]
    assert told == ["left out: seed-2/config.yaml: is gone, or has changed since the run began"]


def test_a_seed_counts_once(runs):
    shutil.copytree("seed-2", "again")
    seeds, told = collected("seed-*", "again")
    assert seeds == [1, 2, 3]
    assert told == ["left out: seed-2: has seed 2, as again has"]


def test_runs_of_other_settings_logs_and_versions_are_not_mixed(runs, fitted, tmp_path: Path):
    from hydroid.run.folder import RunFolder

    def begun(name: str, **changes: object) -> None:
        """The run of seed 3 with the same estimate under other settings."""
        settings = load_settings("article-mech", SMALL | {"search.seed": 3} | changes)
        shutil.rmtree("seed-3")
        RunFolder(tmp_path / "seed-3").begin(settings, [fitted[0] / name])
        shutil.copy(fitted[0] / "seed-3" / "estimate.yaml", "seed-3/estimate.yaml")
        RunFolder(tmp_path / "seed-3").status("done")

    def refused() -> str:
        told: list[str] = []
        with pytest.raises(RunError, match="1 of 3 runs differ from seed-1 in more than the seed"):
            collect(["seed-*"], Path("out"), told.append)
        assert not Path("out").exists()
        (line,) = told
        return line

    begun("log.csv", **{"search.ga.generations": 3})
    assert refused() == "seed-3: has search.ga.generations = 3, not 2"
    (fitted[0] / "other.csv").write_text((fitted[0] / "log.csv").read_text())
    begun("other.csv")
    assert refused().startswith("seed-3: of other logs (other.csv")
    begun("log.csv")
    change(Path("seed-3/run.json"), hydroid="0.0")
    assert refused().startswith("seed-3: made by hydroid 0.0, not ")
    # threads and jobs change no bit
    begun("log.csv", **{"simulation.threads": 1, "cluster.jobs": 7})
    assert collected("seed-*") == ([1, 2, 3], [])


def test_a_run_is_not_written_into(runs):
    with pytest.raises(RunError, match="is a run itself"):
        collect(["seed-*"], Path("seed-1"), pytest.fail)


def test_the_command_names_the_best_run_and_warns_on_the_side(runs):
    change(Path("seed-3/run.json"), status="running")
    done = CliRunner().invoke(app, ["collect", *map(str, runs), "--out", "out", "--json"])
    assert done.exit_code == 0
    found = json.loads(done.stdout)
    assert set(found["runs"]) == {"seed-1", "seed-2"}
    assert found["best"] == min(found["runs"], key=lambda run: found["runs"][run]["rms_deg"])
    assert [row["name"] for row in found["parameters"]] == [*TRUTH, "rms output error"]
    assert done.stderr == "hydroid: left out: seed-3: is not finished (running); finish it with --resume\n"
    done = CliRunner().invoke(app, ["collect", "seed-*", "--out", "out"])
    assert f"smallest error: {found['best']} (seed " in done.stdout
