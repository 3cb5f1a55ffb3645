"""Runs that were made apart come together, and those that do not belong together are
warnings."""

import csv
import json
import shutil
from pathlib import Path

import pytest
import yaml
from typer.testing import CliRunner

import hydroid
from hydroid import read_logs
from hydroid.commands.app import app
from hydroid.errors import RunError

SEEDS = (3, 1, 2)


@pytest.fixture
def runs(array, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[Path]:
    """Copies of the runs, named as from their folder."""
    monkeypatch.chdir(tmp_path)
    for seed in SEEDS:
        shutil.copytree(array[0] / f"seed-{seed}", tmp_path / f"seed-{seed}")
    return [Path(f"seed-{seed}") for seed in SEEDS]


def change(file: Path, **values: object) -> None:
    content = yaml.safe_load(file.read_text()) | values
    file.write_text(
        json.dumps(content) if file.suffix == ".json" else yaml.safe_dump(content)
    )


def collected(
    caplog: pytest.LogCaptureFixture, *names: object
) -> tuple[list[int], list[str]]:
    caplog.clear()
    study = hydroid.report([str(name) for name in names], merge=True, out="out")
    return [run.seed for run in study.result], caplog.messages


def test_the_best_run_is_the_first_of_the_table_of_runs(array, runs):
    merged = hydroid.report(["seed-*"], merge=True, out="out").result
    best = min(merged, key=lambda run: run.rms_deg)
    fits = {seed: one.fit for seed, one in array[1].items()}
    order = sorted(fits, key=lambda seed: fits[seed].best.rms)
    assert best.seed == order[0]
    with Path("out/tables/runs.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [int(row["seed"]) for row in rows] == order
    values = [float(value) for name, value in rows[0].items() if name.endswith("]")][1:]
    assert values == list(fits[best.seed].best.theta)


def test_runs_that_cannot_be_used_are_named_and_left_out(runs, caplog, tmp_path: Path):
    change(Path("seed-1/run.json"), status="interrupted")
    expected = ["left out: seed-1: is not finished (interrupted); resume it"]
    assert collected(caplog, "seed-*") == ([2, 3], expected)
    (tmp_path / "seed-4").mkdir()
    Path("seed-2/estimate.yaml").write_text("parameters: {K: 0.2}\n")
    seeds, warnings = collected(caplog, "seed-*", "nowhere")
    assert seeds == [3]
    named = [line.split(":")[1].split(",")[0].strip() for line in warnings]
    assert named == [
        "nowhere/run.json",
        "seed-1",
        "seed-2/estimate.yaml",
        "seed-4/run.json",
    ]
    with pytest.raises(RunError, match="no finished run is there"):
        collected(caplog, "seed-1", "seed-2", "seed-4")
    with pytest.raises(RunError, match="is a run itself"):
        hydroid.report(["seed-*"], merge=True, out="seed-3")


def test_a_seed_counts_once(runs):
    shutil.copytree("seed-2", "again")
    with pytest.raises(RunError, match="seed-2: has seed 2, as again has"):
        hydroid.report(["seed-*", "again"], merge=True)


def test_runs_of_other_settings_logs_and_versions_are_not_mixed(
    runs, caplog, array, tmp_path: Path
):
    from hydroid.run.folder import RunFolder

    plain = array[1][3].problem.settings

    def begun(name: str, **changes: object) -> None:
        """The run of seed 3 with the same estimate under other settings."""
        settings = plain.changed(changes)
        shutil.rmtree("seed-3")
        RunFolder(tmp_path / "seed-3").begin(
            settings, read_logs([array[0] / name], settings)
        )
        for file in ("estimate.yaml", "result.npz"):
            shutil.copy(array[0] / "seed-3" / file, Path("seed-3") / file)
        RunFolder(tmp_path / "seed-3").status("done")

    def refused() -> str:
        with pytest.raises(RunError) as error:
            hydroid.report(["seed-*"], merge=True, out="out")
        assert not Path("out").exists()
        return str(error.value)

    begun("a.csv", **{"search.ga.generations": 3})
    assert refused().startswith("seed-3: has search.ga.generations = 3, not 2; ")
    lines = (array[0] / "a.csv").read_text().splitlines()
    (array[0] / "other.csv").write_text("\n".join(lines[:-1]))
    begun("other.csv")
    assert refused().startswith("seed-3: has other logs, ")
    begun("a.csv")
    change(Path("seed-3/run.json"), hydroid="0.0")
    assert refused().startswith("seed-3: was made by hydroid 0.0, not ")
    # threads change no bit
    begun("a.csv", **{"simulation.threads": 1})
    assert collected(caplog, "seed-*") == ([1, 2, 3], [])


def test_the_command_names_the_best_run_and_warns_on_the_side(runs):
    change(Path("seed-3/run.json"), status="running")
    done = CliRunner().invoke(
        app, ["report", "--merge", *map(str, runs), "--out", "out", "--json"]
    )
    assert done.exit_code == 0
    found = json.loads(done.stdout)
    assert set(found["runs"]) == {"seed-1", "seed-2"}
    assert found["best"] == min(
        found["runs"], key=lambda run: found["runs"][run]["fitted_deg"]["shoulder"]
    )
    assert (
        done.stderr
        == "hydroid: left out: seed-3: is not finished (running); resume it\n"
    )
