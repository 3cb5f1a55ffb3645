"""The commands as a user meets them: from logs to fits, errors on other logs,
predictions, both stages."""

import json
import logging
import re
import shutil
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
import yaml
from command_line import Run
from conftest import SMALL
from log_files import head

import hydroid
from hydroid.commands.app import click_command
from hydroid.commands.stages import held_mechanics
from hydroid.estimate import FitSummary, ParameterEstimate, write_estimate
from hydroid.findings import Finding
from hydroid.fitting import validation
from hydroid.identified_model import IdentifiedModel
from hydroid.log import Log
from hydroid.prediction import predict
from hydroid.run.record import load_record

ROOT = Path(__file__).parents[2]
QUICK = [
    "--set=search.ga.population=6",
    "--set=search.ga.generations=2",
    "--set=refinement.iterations=1",
]
GA = ["--algorithm", "ga"]
SHORT_DESIGN = "--set=design={effort: 3, poses: any, duration_s: 6}"
VALUES = {
    "D": 80.0,
    "S": 0.0,
    "M1": 4.6,
    "M2": 5.1,
    "M3": 22.5,
    "M4": 1.6,
    "M5": 4.0,
    "M6": 4.7,
}


PROMISES = {
    "page": "*.html",
    "report.html": "report.html",
    "estimate.yaml": "estimate.yaml",
    "tables": "tables/*.csv",
    "figures": "figures/*",
    "fitted arm": "model/*.xml",
    "commands.csv": "commands.csv",
    "predicted.csv": "predicted.csv",
}
"""what help says that a command writes, and the files that this is"""


def test_a_command_writes_what_its_help_promises(
    short: Path, hydroid_cli: Run, tmp_path: Path
):
    hydroid_cli("fit-mech", short, *GA, "--out", "fit-mech", *QUICK)
    for name, options in {
        "validate": [short],
        "analyse": [],
        "suggest": [SHORT_DESIGN],
        "design": [SHORT_DESIGN],
    }.items():
        hydroid_cli(name, *options, "--fit", "fit-mech", "--out", name)
    for name in ("fit-mech", "validate", "analyse", "suggest", "design"):
        command = click_command(name)
        (out,) = (option.help for option in command.params if "--out" in option.opts)
        words = f"{command.help} {out}"
        promised = {
            what
            for what in PROMISES
            if re.search(rf"(Folder for|Writes) [^\[]*{what}", words)
        }
        there = {
            what
            for what, files in PROMISES.items()
            if any((tmp_path / name).glob(files))
        }
        assert promised <= there, name
        assert promised, name


def test_fit_validate_and_simulate_walk_through(
    short: Path, hydroid_cli: Run, tmp_path: Path
):
    done = hydroid_cli("fit-mech", short, *GA, "--out", "run", "--json", *QUICK)
    found = json.loads(done.out)
    assert set(found["estimate"]) == {"K", "D", "S", "M1", "M2", "M3", "M4", "M5", "M6"}
    assert [
        name for name, p in found["estimate"].items() if p["flag"] == "no effect"
    ] == ["M1"]
    run = tmp_path / "run"
    estimate = yaml.safe_load((run / "estimate.yaml").read_text())
    assert estimate | {"out": "run"} == found
    for name in (
        "report.html",
        "history.csv",
        "pareto.csv",
        "tables/parameters.csv",
        "result.npz",
    ):
        assert (run / name).stat().st_size > 0
    described = json.loads((run / "run.json").read_text())
    assert described["status"] == "done"
    assert set(described["seconds"]) == {
        "search",
        "refinement",
        "uncertainty",
        "report",
    }
    # a refinement that ends at its limit of one step says so
    assert found["findings"][0]["numbers"] == {
        "ending": "it reached the iteration limit"
    }

    hydroid_cli("fit-mech", short, *GA, "--out", "run", code=2)  # not twice by mistake

    done = json.loads(
        hydroid_cli("validate", short, "--fit=run", "--json", "--out=val").out
    )
    (row,), (verdict,) = done["results"], done["verdict"]
    assert (verdict["fit"], verdict["name"], verdict["unseen_deg"]) == (
        "run",
        "shoulder",
        None,
    )
    assert verdict["fitted_deg"] == pytest.approx(found["rms_deg"])
    assert set(verdict["baselines_deg"]) == {
        "standing still",
        "speed tables",
        "nine numbers",
    }
    assert 0 <= row["inside_percent"] <= 100
    assert row["rms_deg"] == pytest.approx(
        found["estimates"]["refined"]["rms_deg"], rel=1e-9
    )

    done = hydroid_cli(
        "simulate", short, "--fit", "run/estimate.yaml", "--out", "sim.csv"
    )
    assert done.out == "sim.csv\n"
    done = json.loads(
        hydroid_cli(
            "validate", "sim.csv", "--fit", "run", "--json", "--out", "val2"
        ).out
    )
    # its own prediction tests nothing, and is not kept
    assert done["results"][0]["max_deg"] < 1e-6
    assert done["verdict"][0]["unseen_deg"] is None
    assert not [*run.glob("validations/*")]
    head(tmp_path / "other.csv", 600, "rig_shoulder_2.csv")
    hydroid_cli("validate", "other.csv", "--fit", "run", "--out", "val2")
    # the fit's own report shows it
    (kept,) = run.glob("validations/other.csv-*/result.npz")
    assert kept.stat().st_size > 0
    assert sorted(p.name for p in tmp_path.iterdir()) == [
        "other.csv",
        "run",
        "sim.csv",
        "val",
        "val2",
    ]


@pytest.mark.parametrize("name", ["./short.csv", "again.csv"])
def test_a_log_that_is_given_twice_is_refused(
    short: Path, hydroid_cli: Run, tmp_path: Path, name: str
):
    for file in ("short.csv", name):
        (tmp_path / file).write_text(short.read_text() + "# saved again\n")
    done = hydroid_cli("fit-mech", "short.csv", name, *GA, *QUICK, code=2)
    assert "holds the same samples as short.csv; leave one of them out" in done.err


@pytest.mark.usefixtures("no_report")
def test_the_logs_of_the_fits_that_a_fit_began_from_are_seen(
    short: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """Of a chain of three, and of a fit in memory; each log is kept once."""
    monkeypatch.chdir(tmp_path)
    rows = (ROOT / "examples" / "logs" / "rig_shoulder_2.csv").read_text().splitlines()
    logs = {"first": short}
    for name, first in {"second": 1, "third": 501, "other": 1001}.items():
        logs[name] = tmp_path / f"{name}.csv"
        logs[name].write_text("\n".join([rows[0], *rows[first : first + 400]]) + "\n")
    tiny = {"search.ga.population": 4, "search.ga.generations": 1}
    quick = {"algorithm": "ga", "refinement": False, "set": tiny}
    hydroid.fit_mech(logs["first"], out="first", **quick)
    hydroid.fit_mech(
        [logs["first"], logs["second"]], start="first", out="second", **quick
    )
    third = hydroid.fit_mech(logs["third"], start="second", out="third", **quick)
    assert [log.source for log in third.earlier] == [
        str(logs["first"]),
        str(logs["second"]),
    ]
    for fit in ("third", third):
        validated = hydroid.validate([*logs.values()], fit=fit)
        assert [one.unseen for one in validated.result] == [False, False, False, True]


def test_a_log_set_apart_stays_on_the_page_and_out_of_the_verdict(
    array, hydroid_cli: Run
):
    shutil.copytree(array[0] / "seed-1", "run")
    other = head(Path("rig_shoulder_2.csv"), 600, "rig_shoulder_2.csv")
    counts = {}
    for options in (["--apart"], []):
        done = hydroid_cli(
            "validate", other, "--fit=run", "--json", "--out=val", *options
        )
        # of this very validation
        assert json.loads(done.out)["verdict"][0]["unseen_logs"] == 1
        (one,) = load_record("run").verdict
        counts[len(options)] = one.unseen_logs
        text = Path("run/report.html").read_text("utf-8")
        assert ("The verdict does not count rig_shoulder_2.csv" in text) == bool(
            options
        )
        assert "rig_shoulder_2" in text
    assert counts == {1: 0, 0: 1}


def test_a_log_in_other_units_tests_nothing_and_is_not_kept(array, hydroid_cli: Run):
    """Commands of -1 to 1, where those of the fit are in percent."""
    shutil.copytree(array[0] / "seed-1", "run")
    rows = (ROOT / "examples" / "logs" / "rig_shoulder_2.csv").read_text().splitlines()
    names = rows[0].split(",")
    commands = [number for number, name in enumerate(names) if name.endswith("_pct")]
    lines = [rows[0]]
    for row in rows[1:601]:
        cells = row.split(",")
        for number in commands:
            cells[number] = f"{float(cells[number]) / 100:g}"
        lines.append(",".join(cells))
    Path("parts.csv").write_text("\n".join(lines) + "\n")
    done = hydroid_cli("validate", "parts.csv", "--fit=run", "--json", "--out=val")
    assert "parts.csv: seems to be in other units" in done.err
    assert json.loads(done.out)["verdict"][0]["unseen_logs"] == 0
    assert load_record("run").verdict[0].unseen_logs == 0
    assert not load_record("run").validations


def test_a_log_that_diverges_is_named_and_judged_with_the_others(
    short: Path, array, hydroid_cli: Run, monkeypatch: pytest.MonkeyPatch
):
    shutil.copytree(array[0] / "seed-1", "run")
    rows = (ROOT / "examples" / "logs" / "rig_shoulder_2.csv").read_text().splitlines()
    for name, samples in {
        "good.csv": rows[1:1001],
        "lost.csv": rows[1001:2001],
    }.items():
        Path(name).write_text("\n".join([rows[0], *samples]) + "\n")

    def lost(model: IdentifiedModel, log: Log, joints: Sequence[int]) -> np.ndarray:
        return predict(model, log, joints) * (np.nan if log.source == "lost.csv" else 1)

    monkeypatch.setattr(validation, "predict", lost)
    monkeypatch.setattr(
        validation, "predict_with_oil", lambda *given: (lost(*given), None)
    )
    done = hydroid_cli(
        "validate", "good.csv", "lost.csv", "--fit=run", "--out=val", "--json"
    )
    assert (
        done.err
        == "hydroid: warning: run predicts no joint in lost.csv: its simulation diverged\n"
    )
    found = json.loads(done.out)
    (verdict,) = found["verdict"]
    assert verdict["unseen_deg"] is None
    assert verdict["verdict"] in ("does not fit", "predicts worse than it fits")
    assert verdict["horizons_deg"]["the fit"][0] is None
    assert {row["log"]: row["rms_deg"] is None for row in found["results"]} == {
        "good.csv": 0,
        "lost.csv": 1,
    }
    for page in ("val/validation.html", "run/report.html"):
        text = Path(page).read_text("utf-8")
        assert f"✗ {verdict['verdict']}" in text
        assert "diverged" in text


def test_values_that_diverge_are_judged(short: Path, hydroid_cli: Run):
    Path("values.yaml").write_text(yaml.safe_dump(VALUES | {"K": 1e9}))
    passive = "--set=simulation.other_joints=passive"
    done = hydroid_cli("validate", short, "--fit=values.yaml", passive, "--json")
    (judged,) = json.loads(done.out)["verdict"]
    assert (judged["verdict"], judged["beside"]) == (
        "predicts no better",
        "standing still",
    )


def test_python_does_what_the_terminal_does_and_shows_it(short: Path, hydroid_cli: Run):
    arguments = ["fit-mech", short, *GA, "--seed", 5, "--no-refinement", *QUICK[:2]]
    printed = hydroid_cli(*arguments).out
    assert len(printed.splitlines()) <= 20
    assert "shoulder  ✗ does not fit" in printed
    fitted = hydroid.fit_mech(short, seed=5, refinement=False, set=SMALL, out="python")
    own = Path("runs/fit-mech/estimate.yaml").read_bytes()
    assert Path("python/estimate.yaml").read_bytes() == own
    assert len(repr(fitted)) < 200
    assert all(
        f"<td>{name}</td>" in fitted._repr_html_() for name in fitted.summary.values
    )


def test_a_fit_in_memory_steps_predicts_validates_reports_and_tables_itself(
    short: Path, tmp_path: Path
):
    before = sorted(tmp_path.iterdir())
    fitted = hydroid.fit_mech(short, refinement=False, set=SMALL)
    assert fitted.to_frame()["value"].to_dict() == fitted.summary.values
    predicted = fitted.predict(short)
    assert np.array_equal(predicted.response, fitted.predictions[0].response)
    assert predicted.ahead.shape[1:] == (5, 1)
    validated = fitted.validate(short)
    assert (
        validated.lines[1]
        == f"The fit, or one that it began from, was made with {short}: that tests nothing."
    )
    (seen,) = validated.content["verdict"]
    assert (seen["unseen_deg"], seen["fitted_deg"]) == (
        None,
        pytest.approx(fitted.summary.rms_deg),
    )
    other = ROOT / "examples" / "logs" / "rig_shoulder_2.csv"
    (unseen,) = fitted.validate(other).content["verdict"]
    assert unseen["fitted_deg"] == seen["fitted_deg"]
    assert len(unseen["horizons_deg"]["nine numbers"]) == 5
    start = fitted.model.settings.arm.pose("study")
    np.testing.assert_array_equal(fitted.plant().reset("study"), start)
    np.testing.assert_array_equal(hydroid.load_plant(fitted).reset("study"), start)
    assert sorted(tmp_path.iterdir()) == before
    assert fitted.report(tmp_path / "page").stat().st_size > 0


def test_analyse_tells_what_a_log_determines(array, hydroid_cli: Run, tmp_path: Path):
    values = tmp_path / "values.yaml"
    values.write_text(
        "{K: 1.5, D: 400, S: 80, M1: 4.6, M2: 5.1, M3: 22.5, M4: 1.6, M5: 4.0, M6: 4.7}"
    )
    how = ["--fit", values, "--profile", "S"]
    done = hydroid_cli(
        "analyse",
        array[0] / "a.csv",
        *how,
        "--set",
        "objective.noise_deg=0.5",
        "--out",
        "told",
        "--json",
    )
    found = json.loads(done.out)
    assert ["M1"] in [
        f["subjects"] for f in found["findings"] if f["kind"] == "no effect"
    ]
    rows = found["estimate"]
    assert set(rows) == {"K", "D", "S", "M1", "M2", "M3", "M4", "M5", "M6"}
    assert rows["M1"]["flag"] == "no effect"
    assert rows["M1"]["source"] == "prior only"
    assert rows["M1"]["data_share"] == 0
    assert rows["S"]["profile_interval"] is not None
    for name in ("parameters", "correlations"):
        assert (tmp_path / "told" / "tables" / f"{name}.csv").stat().st_size > 0


def test_a_term_to_free_has_its_command(
    short: Path, hydroid_cli: Run, monkeypatch: pytest.MonkeyPatch
):
    numbers = {"part": 50.0, "command": "hydroid fit-hyd a.csv"}
    said = {"tested": 1, "left_out_deg": {"shoulder": 2.0}, "terms": [], "actions": []}
    advised = said, [Finding("term missing", "warning", ("delay", "shoulder"), numbers)]
    monkeypatch.setattr("hydroid.advice.suggestions.advice", lambda *_: advised)
    Path("values.yaml").write_text(yaml.safe_dump(VALUES | {"K": 1.5, "S": 80.0}))
    printed = hydroid_cli("suggest", short, "--fit", "values.yaml").out
    assert "falls too.\n  hydroid fit-hyd a.csv\n" in printed


def test_the_second_stage_walks_through(short: Path, hydroid_cli: Run, tmp_path: Path):
    (tmp_path / "mech.yaml").write_text(yaml.safe_dump(VALUES))
    arguments = ["fit-hyd", short, "--mech", "mech.yaml", *GA, "--out", "run", *QUICK]
    # the errors below are those from the measured start
    changes = ["--set=joint_refinement=true", "--set=free_start=false"]
    found = json.loads(hydroid_cli(*arguments, *changes, "--json").out)
    assert list(found["estimates"]) == ["best", "refined", "joint"]
    held = found["estimates"]["refined"]["values"]
    assert all(held[name] == value for name, value in VALUES.items() if name != "D")
    rms = [found["estimates"][name]["rms_deg"] for name in ("best", "refined", "joint")]
    assert rms == sorted(rms, reverse=True)
    hydroid_cli("simulate", short, "--fit", "run/estimate.yaml", "--out", "s.csv")
    judged = json.loads(
        hydroid_cli("validate", "s.csv", "--fit", "run", "--json", "--out", "v").out
    )
    assert judged["results"][0]["max_deg"] < 1e-6


def test_check_prints_json_and_says_by_its_status_that_a_log_is_unusable(
    short: Path, hydroid_cli: Run
):
    Path("broken.csv").write_text("time_s,u1_pct\n0,1\n0.01,x\n")
    good, bad = json.loads(
        hydroid_cli("check", short, "broken.csv", "--json", code=2).out
    )["logs"]
    assert (good["usable"], good["driven_joints"]) == (True, ["shoulder"])
    assert not bad["usable"]
    assert {finding["level"] for finding in bad["findings"]} >= {"error"}


def test_check_refuses_logs_that_leave_stage_two_nothing_to_fit(
    short: Path, hydroid_cli: Run
):
    """As the fit itself does; a standstill beside a log that drives the joint is
    right."""
    undriven = ("--config=fit-hyd", "--json", "--set=log.command=null")
    (one,) = json.loads(hydroid_cli("check", short, *undriven, code=2).out)["logs"]
    assert (one["usable"], one["findings"][0]["kind"]) == (False, "nothing to fit")
    rows = short.read_text().splitlines()
    column = rows[0].split(",").index("u2_pct")
    still = [row.split(",") for row in rows[1:]]
    for row in still:
        row[column] = "0"
    Path("still.csv").write_text("\n".join([rows[0], *map(",".join, still)]))
    hydroid_cli("check", "still.csv", "--config=fit-hyd", code=2)
    both = json.loads(
        hydroid_cli("check", "still.csv", short, "--config=fit-hyd", "--json").out
    )["logs"]
    assert [log["usable"] for log in both] == [True, True]


def test_a_compared_joint_that_no_log_drives_is_not_tested(short: Path, caplog):
    """Its fit ends with a verdict on the other; it is warned of before the first
    simulation."""
    two = {"outputs": [2, 3], "simulation.other_joints": "measured"}
    with caplog.at_level(logging.WARNING, "hydroid"):
        fitted = hydroid.fit_mech(short, refinement=False, set=SMALL | two)
    assert any(
        "no log drives joint elbow, compared all the same" in line
        for line in caplog.messages
    )
    shoulder, elbow = fitted.summary.verdict
    assert (elbow.name, elbow.verdict, elbow.fitted_deg) == (
        "elbow",
        "not tested",
        None,
    )
    assert any(f"allowed error: {shoulder.name}," in str(line) for line in fitted.lines)


def test_stage_two_holds_masses_and_says_which_stage_1_moved_without_knowing_it(
    tmp_path: Path, caplog
):
    """The arm's file has 5.1 and 22.5 kg: M2 was moved, M3 stayed, and the logs know
    M4."""
    flags = {
        "M2": "weakly identifiable",
        "M3": "not identifiable",
        "M4": "identifiable",
    }
    values = VALUES | {"M2": 8.0, "M3": 22.6, "M4": 3.0}
    flags = {n: "fixed" if n[0] == "M" else "not identifiable" for n in values} | flags
    known = {
        n: ParameterEstimate(value=v, unit="?", flag=flags[n])
        for n, v in values.items()
    }
    write_estimate(tmp_path, FitSummary(stage="mech", estimate=known))
    with caplog.at_level(logging.WARNING, "hydroid"):
        held = held_mechanics(tmp_path, hydroid.load_settings("fit-hyd"), {})
    (line,) = caplog.messages
    assert line.startswith(
        "M2 is held at 8 kg, which the logs of stage 1 do not determine (weak"
    )
    settings = hydroid.load_settings("fit-hyd", held)
    # the masses hold; the damping and the spring of stage 2 have a start and a value of
    # their own
    masses = {name: value for name, value in values.items() if name.startswith("M")}
    assert {name: settings.parameters[name].fixed for name in masses} == masses
    assert settings.parameters["D"].fixed is None
    assert settings.parameters["S"].fixed == 0.0
