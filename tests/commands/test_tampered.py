"""Finished runs that were damaged, forged or edited: nothing is believed, and a line
says what is wrong."""

import hashlib
import io
import json
import shutil
import struct
import zipfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from command_line import Run
from conftest import SMALL
from log_files import RIG

import hydroid
from hydroid.commands.validate import validate
from hydroid.log import Log
from hydroid.run.archive import pack, unpack
from hydroid.run.folder import log_hash
from hydroid.run.record import RESULT, VALIDATIONS, load_record, validation_name

pytestmark = pytest.mark.usefixtures("no_report")
RESUMED = [
    "fit-mech",
    "a.csv",
    "--config",
    "run/config.yaml",
    "--out",
    "run",
    "--resume",
]
"""the command that goes on with the run"""


@pytest.fixture
def run(array: tuple[Path, dict[int, hydroid.FitResult]], tmp_path: Path) -> Path:
    """A finished run beside its log, a.csv."""
    shutil.copy(array[0] / "a.csv", tmp_path)
    return Path(shutil.copytree(array[0] / "seed-1", tmp_path / "run"))


def sealed(content: bytes) -> bytes:
    """With a right digest, as a program that means harm would write it."""
    return content + hashlib.sha256(content).digest()


def npz(words: bytes) -> bytes:
    buffer = io.BytesIO()
    np.savez(buffer, content=np.frombuffer(words, np.uint8))
    return buffer.getvalue()


def huge() -> bytes:
    """An array that says it has 150 GB."""
    header = (
        b"{'descr': '<f8', 'fortran_order': False, 'shape': (20000000000,), }".ljust(
            117
        )
        + b"\n"
    )
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as file:
        file.writestr(
            "content.npy",
            b"\x93NUMPY\x01\x00" + struct.pack("<H", 118) + header + b"\0" * 1000,
        )
    return buffer.getvalue()


FORGED = {
    "no zip": b"PK\x03\x04junk",
    "deep": npz(b"[" * 100_000),
    "150 GB": huge(),
    "a list": npz(b"[1, 2]"),
    "no array": npz(b'{"array": "a7"}'),
    "a list for a name": npz(b'{"array": [1]}'),
    "nothing": npz(b""),
}


@pytest.mark.parametrize("content", FORGED.values(), ids=FORGED)
def test_a_forged_result_or_checkpoint_is_one_line(
    run: Path, content: bytes, hydroid_cli: Run
):
    (run / RESULT).write_bytes(sealed(content))
    assert f"{RESULT}: cannot be read" in hydroid_cli("report", "run", code=2).err
    (run / "checkpoint.npz").write_bytes(sealed(content))
    (run / "checkpoint.previous.npz").unlink(missing_ok=True)
    assert "checkpoint.npz: is damaged" in hydroid_cli(*RESUMED, code=2).err


def test_what_is_packed_comes_back_to_the_bit(tmp_path: Path):
    rng = np.random.default_rng(0)
    arrays = [
        rng.random((3, 4)).T,
        np.zeros((0, 5)),
        np.array(2.5),
        np.arange(6)[::2],
        rng.random(4) > 0.5,
    ]
    (tmp_path / "x").write_bytes(pack({"parts": arrays, "more": [1, None, "ä"]}))
    back = unpack(tmp_path / "x")
    assert back["more"] == [1, None, "ä"]
    for one, other in zip(arrays, back["parts"], strict=True):
        assert (one.dtype, one.shape) == (other.dtype, other.shape)
        np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize(
    "content", ["[1, 2]", '{"files": [1, 2]}', '{"logs": {"a": 1}}', "[" * 10**5]
)
def test_a_description_that_is_none_is_one_line(
    run: Path, content: str, hydroid_cli: Run
):
    (run / "run.json").write_text(content)
    hydroid_cli("report", "run", code=2)
    assert "run.json: " in hydroid_cli(*RESUMED, code=2).err


def test_a_damaged_validation_is_left_out(run: Path, hydroid_cli: Run):
    (run / VALIDATIONS / "x").mkdir(parents=True)
    (run / VALIDATIONS / "x" / RESULT).write_bytes(b"junk")
    done = hydroid_cli("report", "run")
    assert (
        f"left out: run/{VALIDATIONS}/x/{RESULT}: cannot be read (ValueError); validate again"
        in done.err
    )
    assert load_record(run).validations == {}


COMMANDS = [
    ["simulate", "a.csv", "--fit", "run"],
    ["validate", "a.csv", "--fit", "run"],
    ["report", "run"],
]


FILES = [
    "config.yaml",
    "arm.yaml",
    "estimate.yaml",
    "model/arm.xml",
    "model/meshes/base.stl",
]


@pytest.mark.parametrize("name", FILES)
@pytest.mark.parametrize("command", COMMANDS, ids=[command[0] for command in COMMANDS])
def test_a_run_that_lacks_one_of_its_files_is_refused_in_one_line(
    run: Path, command: list[str], name: str, hydroid_cli: Run
):
    (run / name).unlink()
    said = hydroid_cli(*command, code=2).err
    assert said == f"hydroid: run/{name}: is missing; put it back, or fit again\n"


def moved(text: str) -> str:
    return text.replace("period_s: 0.01", "period_s: 0.02")


EDITS: dict[str, Callable[[str], str]] = {
    "config.yaml": moved,
    "estimate.yaml": lambda text: f"{text}\n",
}


@pytest.mark.parametrize("command", COMMANDS, ids=[command[0] for command in COMMANDS])
@pytest.mark.parametrize("name", EDITS)
def test_an_edited_run_is_said_once(
    run: Path, command: list[str], name: str, hydroid_cli: Run
):
    assert "is not as the fit left it" not in hydroid_cli(*command).err
    (run / name).write_text(EDITS[name]((run / name).read_text()))
    assert (
        hydroid_cli(*command).err.count(f"run/{name}: is not as the fit left it") == 1
    )


def test_a_log_of_the_run_that_has_changed_is_said(run: Path, hydroid_cli: Run):
    values = (run / "run.json").read_text()
    (name,) = json.loads(values)["logs"]
    here = {str(run.parent / "a.csv"): json.loads(values)["logs"][name]}
    (run / "run.json").write_text(json.dumps(json.loads(values) | {"logs": here}))
    assert "was fitted to" not in hydroid_cli("analyse", "--fit", "run").err
    text = Path("a.csv").read_text().splitlines()
    Path("a.csv").write_text("\n".join(text[:-20]) + "\n")
    assert (
        "a.csv: is not what run was fitted to"
        in hydroid_cli("analyse", "--fit", "run").err
    )


def test_samples_decide_whether_a_log_is_unseen(run: Path):
    rows = Path(run.parent / "a.csv").read_text().splitlines()
    (again := run.parent / "again.csv").write_text(
        "\n".join(["# saved again", *rows]) + "\n"
    )
    (part := run.parent / "part.csv").write_text(
        "\n".join([rows[0], *rows[150:]]) + "\n"
    )
    other = RIG / "rig_shoulder_2.csv"
    converted = run.parent / "converted.csv"
    hydroid.convert(again, out=converted, config="fit-mech", set={"log.period_s": 0.02})
    for log, unseen in (
        (again, False),
        (part, False),
        (converted, False),
        (other, True),
    ):
        validated = validate(log, fit=run, out=run.parent / "page")
        assert [one.unseen for one in validated.result] == [unseen]
    assert len(load_record(run).validations) == 1


def test_a_run_without_the_rows_of_its_files_is_still_read(run: Path):
    """Earlier versions did not store them."""
    (fitted,) = load_record(run).result.fitted
    lines = (run.parent / "a.csv").read_text().splitlines()
    assert fitted.log.rows.count == len(lines) - 1
    tree = unpack(run / RESULT)
    for one in tree["fitted"]:
        del one["log"]["rows"]
    (run / RESULT).write_bytes(pack(tree))
    (earlier,) = load_record(run).result.fitted
    assert earlier.log.rows is None
    np.testing.assert_array_equal(earlier.log.angle, fitted.log.angle)


def test_validations_of_one_name_are_kept_and_a_copy_counts_once(
    run: Path, monkeypatch: pytest.MonkeyPatch
):
    rows = (RIG / "rig_shoulder_2.csv").read_text().splitlines()
    days = {"day1": rows[1:400], "day2": rows[500:900], "copy": rows[1:400]}
    for day, samples in days.items():
        folder = run.parent / day
        folder.mkdir()
        (folder / "log.csv").write_text("\n".join([rows[0], *samples]) + "\n")
        monkeypatch.chdir(folder)
        for _ in range(2):  # the same file again is replaced
            validate("log.csv", fit=run, out="page")
    assert len([*run.glob(f"{VALIDATIONS}/*")]) == 3
    sources = [one.log.source for one in load_record(run).validations.values()]
    assert sorted(sources) == ["log.csv", "log.csv (2)"]


def test_a_validation_stays_below_its_folder_whatever_the_log_is_called(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    def name(source: object) -> str:
        time = np.arange(3) * 0.01
        return validation_name(
            Log(str(source), time, np.zeros((3, 1)), np.zeros((3, 1)), 0.01)
        )

    (tmp_path / "bag" / "sub").mkdir(parents=True)
    monkeypatch.chdir(tmp_path / "bag" / "sub")
    up = name("..")
    monkeypatch.chdir(tmp_path / "bag")
    assert up == name(".") == name(tmp_path / "bag")
    assert up.startswith("bag-")
    assert name("x\0y").startswith("x_y-")
    assert len(name("x" * 300).encode()) < 255
    assert (
        len({name(tmp_path / letters / "log") for letters in ("日", "本")}) == 1
    )  # in memory: samples alone
    for letters in ("日", "本"):
        (tmp_path / letters).mkdir()
    assert name(tmp_path / "日") != name(tmp_path / "本")


def test_whatever_decides_a_result_is_in_the_hash_of_its_log():
    settings = hydroid.load_settings(
        "article-mech", {"log.groups": {"monday": "mon_*"}}
    )
    time, zeros = np.arange(5) * 0.01, np.zeros((5, 2))
    pressure = np.zeros((5, 2, 2))
    log = Log("a.csv", time, zeros, zeros, 0.01, pressure)
    loaded = settings.changed({"payloads": {"a.csv": 100.0}})
    others = [
        log_hash(replace(log, pressure=pressure + 1.0), settings),
        log_hash(replace(log, pressure=None), settings),
        log_hash(replace(log, rest=2), settings),
        log_hash(replace(log, source="mon_1.csv"), settings),
        log_hash(log, loaded),
        log_hash(log, settings),
    ]
    assert len({*others}) == len(others)
    assert log_hash(replace(log, source="moved/b.csv"), settings) == others[-1]
    (copy := replace(log, angle=zeros.copy())).angle[3, 1] = 1e-12
    assert log_hash(copy, settings) != others[-1]


def test_an_unseen_log_of_a_loaded_ones_name_is_said_to_be_loaded(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
):
    rows = (RIG / "rig_shoulder_1.csv").read_text().splitlines()
    logs = [tmp_path / day / "a.csv" for day in ("monday", "tuesday")]
    for number, log in enumerate(logs):
        log.parent.mkdir()
        samples = rows[1 + 300 * number : 300 * (number + 1)]
        log.write_text("\n".join([rows[0], *samples]) + "\n")
    small = SMALL | {"refinement.iterations": 1, "payloads": {"a.csv": 5.0}}
    caplog.set_level("INFO", "hydroid")
    fit = hydroid.fit_mech(logs[0], set=small)
    hydroid.validate(logs[0], fit=fit)
    assert "is taken to hold" not in caplog.text
    hydroid.validate(logs[1], fit=fit)
    assert f"{logs[1]}: is taken to hold 5 kg, by its name (payloads)" in caplog.text


def test_a_simulated_log_is_none_of_the_commands(run: Path):
    simulated = hydroid.simulate(run.parent / "a.csv", fit=run).log
    assert simulated.source == "simulated a.csv"
    assert hydroid.simulate(
        run.parent / "a.csv", fit=run, out=run.parent / "s.csv"
    ).log.source.endswith("s.csv")
