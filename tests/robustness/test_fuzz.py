"""Bad input: files that were once misread or crashed hydroid, and some damaged ones of
every kind.

FUZZ=50 in the environment reads fifty times as many.
"""

import os
import time
from pathlib import Path
from random import Random

import pytest
from field_logs import FIELD_LOGS, make_truth
from fuzz import KINDS as FILES, damage, logs, run, run_kinds
from fuzz_formats import FORMATS, bounded

import hydroid
from hydroid.errors import HydroidError, SettingsError
from hydroid.log import open_table
from hydroid.project.layout import find_layout
from hydroid.settings.arm import Arm, load_arm
from hydroid.settings.document import read_document

TIMES = int(os.environ.get("FUZZ", "1"))
KINDS = FILES | FORMATS
COUNTS = dict.fromkeys(FORMATS, 15) | {
    "log": 40,
    "names": 20,
    "config": 40,
    "set": 40,
    "arm": 25,
    "mesh": 25,
    "values": 10,
    "model": 8,
    "urdf": 8,
    "mjcf": 8,
}
HEADER = logs()[0].split(b"\n", 1)[0]


@pytest.mark.usefixtures("short_searches")
@pytest.mark.parametrize("name", COUNTS)
def test_damaged_files_are_read_rightly_or_refused_in_one_line(
    name: str, tmp_path, monkeypatch
) -> None:
    files, work = tmp_path / "files", tmp_path / "work"
    files.mkdir()
    work.mkdir()
    monkeypatch.chdir(work)
    kind, accepted = KINDS[name], list[bool]()
    for seed in range(COUNTS[name] * TIMES):
        with bounded(max(map(len, kind.seeds()))):
            accepted.append(kind.read_damaged(files, seed))
    assert os.listdir(work) == []  # nothing is written where nobody asked for it
    assert not all(accepted)


@pytest.mark.usefixtures("short_searches")
@pytest.mark.parametrize(
    "name", ["log", "config", "arm", "mesh", "values", "model", "urdf", "mjcf"]
)
def test_intact_files_are_accepted(name: str, tmp_path: Path) -> None:
    for data in KINDS[name].seeds():
        assert KINDS[name].read(tmp_path, data)


@pytest.mark.parametrize("name", FORMATS)
def test_a_format_is_read_or_refused_in_one_line_whatever_its_columns(
    name: str, tmp_path: Path
) -> None:
    plain, *odd = FORMATS[name].seeds()
    assert FORMATS[name].read(tmp_path, plain)
    for data in {*odd}:
        FORMATS[name].read(tmp_path, data)


ROWS = 300
"""of logs that are damaged: rest and some steps"""


@pytest.mark.slow
def test_damaged_logs_of_machines_are_understood_or_refused_in_one_line(
    tmp_path: Path,
) -> None:
    """What `init` makes of them: pulses, counts, lengths of cylinders, dates."""
    hydroid.init(tmp_path / "mine")
    arm = load_arm(tmp_path / "mine" / "arm.yaml")
    texts = dict[str, bytes]()
    for log in FIELD_LOGS:
        lines = log.write(make_truth(log.steps, arm), arm).splitlines(keepends=True)
        texts[log.name] = "".join(lines[:ROWS]).encode()
    path = tmp_path / "log.csv"
    refused = 0
    files = 2_000 * TIMES
    for seed in range(files):
        rng = Random(f"machine {seed}")
        name = rng.choice([*texts])
        data = damage(rng, texts[name])
        path.write_bytes(data)
        try:
            with bounded(len(data)):
                line = _refusal(path, arm)
        except Exception as error:
            error.add_note(f"the damaged {name} of seed {seed}")
            raise
        if line is not None:
            refused += 1
            assert line.isprintable(), seed
    assert 0 < refused < files / 2


def _refusal(path: Path, arm: Arm) -> str | None:
    """Return why a log was refused; None: something was made of it."""
    try:
        layout = find_layout(open_table(path), arm)
    except HydroidError as refusal:
        return str(refusal)
    assert layout.missing or layout.section["joints"]
    return None


@pytest.mark.slow
def test_damaged_runs_are_refused_in_one_line(
    tmp_path_factory: pytest.TempPathFactory,
) -> None:
    kept = tmp_path_factory.mktemp("kept")
    for kind in run_kinds(kept):
        room = tmp_path_factory.mktemp("room")
        assert kind.read(room, kind.seeds()[0]), kind.name
        accepted = [kind.read_damaged(room, seed) for seed in range(20 * TIMES)]
        if kind.name.endswith(".yaml"):  # a validation reads no other file of a run
            assert not all(accepted), kind.name


@pytest.mark.parametrize(
    "data",
    [
        b"",
        HEADER,
        HEADER + b"\n",
        b",".join([b"c%d" % k for k in range(100_000)]) + b"\n1\n",
        HEADER + b"\n" + b"1," * 100_000,
        HEADER + b"\n" + b"9" * 10_000_000,
        b'"' * 99_999 + b"\n" + b'"' * 99_999,
        HEADER + b'\n"' + b"\n" * 300_000,
        HEADER + b"\n" + b"\n".join(b"%d" % k + b",0" * 14 for k in range(20_000)),
        HEADER + b"\n" + b"\n".join(b"%de300" % k + b",1e308" * 14 for k in range(200)),
        HEADER + b"\n" + b"x" * 50_000_000,
        bytes(range(256)) * 4000,
        b"\xff\xfe" + b"\x00" * 1001,
        b"time_s\0,u1_pct\n0,0\n",
    ],
)
def test_hostile_logs_are_refused_at_once(tmp_path: Path, data: bytes) -> None:
    started = time.process_time()
    assert not KINDS["log"].read(tmp_path, data)
    assert time.process_time() - started < 10


BEGINNINGS = {
    "a.csv": HEADER + b"\n",
    "a.bag": b"#ROSBAG V2.0\n",
    "a.mcap": b"\x89MCAP0\r\n",
    "a.parquet": b"PAR1",
    "v5.mat": b"MATLAB 5.0 MAT-file",
    "v73.mat": b"\x89HDF\r\n\x1a\n",
}


@pytest.mark.parametrize("name", BEGINNINGS)
def test_gigabytes_behind_the_first_bytes_of_a_format_are_not_read(
    name: str, tmp_path: Path
) -> None:
    path = tmp_path / name
    path.write_bytes(BEGINNINGS[name])
    os.truncate(path, 2**33)  # a sparse file
    with bounded(0):
        assert run(("check", str(path))) is not None


NAMES = {
    "brackets": b"[" * 1_000_000,
    "numbers in brackets": b"u[1" * 300_000,
    "a word": b"A" * 1_000_000,
    "spaces": b"u1 [V]" + b" " * 300_000 + b"x",
}


@pytest.mark.parametrize("name", NAMES.values(), ids=NAMES)
@pytest.mark.parametrize("kind", ["log", "names"])
def test_a_name_without_end_is_refused_at_once(
    kind: str, name: bytes, tmp_path: Path
) -> None:
    started = time.process_time()
    assert not KINDS[kind].read(tmp_path, logs()[0].replace(b"u2_pct", name))
    assert time.process_time() - started < 10


@pytest.mark.parametrize("part", ["outputs=[1] ", "outputs=[\0] ", "[" * 30])
def test_a_setting_without_end_is_refused_at_once(part: str, tmp_path: Path) -> None:
    data = (part * (20_000_000 // len(part))).encode()
    started = time.process_time()
    assert not KINDS["set"].read(tmp_path, data)
    assert time.process_time() - started < 2


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("010", 10),
        ("1e3", 1000.0),
        ("-1.5e-3", -0.0015),
        ("yes", "yes"),
        ("1:30", "1:30"),
        ("0x10", "0x10"),
    ],
)
def test_numbers_are_read_as_they_are_meant(text: str, value: object) -> None:
    found = read_document(f"a: {text}", "f")[0]["a"]
    assert found == value
    assert type(found) is type(value)


LAUGHS = "a0: &a0 [x]\n" + "".join(
    f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 9)}]\n" for i in range(1, 12)
)


@pytest.mark.parametrize(
    "text",
    [
        *(
            LAUGHS,
            "a: &a [*a]",
            "[" * 5000,
            "1: a\n01: b",
            "? [a]\n: b",
            "a: !!set {b}",
        ),
        *(
            "a: !!python/name:os.system",
            'a: "\\ud800"',
            'a: "\\0"',
            "a: \0",
            "a: b: c",
            "a: !!int x",
        ),
    ],
)
def test_yaml_that_is_no_data_is_refused(text: str) -> None:
    with pytest.raises(SettingsError) as caught:
        read_document(text, "f.yaml")
    assert str(caught.value).startswith("f.yaml")
    assert str(caught.value).isprintable()
