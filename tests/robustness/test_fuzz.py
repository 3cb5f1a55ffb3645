"""Bad input, the quick part: a thousand damaged files, and faults that were found this way.

`make fuzz` reads ten thousand and more, with a watchdog; what is compared stands in `fuzz_oracles`.
"""

import os
import time
from pathlib import Path

import numpy as np
import pytest
from fuzz_kinds import (
    KINDS,
    basis,
    put,
    read_a_config,
    read_a_log,
    read_a_page,
    read_an_override,
    read_values,
)
from hypothesis import given, settings
from hypothesis import strategies as st

from hydroid.arm.model import load_model
from hydroid.assets import assets
from hydroid.errors import HydroidError, SettingsError
from hydroid.run.folder import RunFolder
from hydroid.settings.document import read_document
from hydroid.settings.fit import FitSettings
from hydroid.settings.load import validate

COUNTS = {
    "log": 200,
    "config": 150,
    "set": 120,
    "arm": 120,
    "values": 120,
    "run": 50,
    "checkpoint": 80,
    "model": 40,
}
COUNTS |= {"mesh": 100, "page": 40}
GAIN = "parameters:\n  K: {quantity: gain, bounds: [0.1, 1]}\n  D: {quantity: damping, fixed: 200}\n"


@pytest.fixture(scope="module")
def room(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("fuzz")


def handled(read, *arguments: object) -> bool:
    """Whether a file was accepted; False where it was refused in one line. All else is a failure."""
    try:
        read(*arguments)
    except HydroidError as refusal:
        text = str(refusal)
    else:
        return True
    assert text.isprintable()
    assert 0 < len(text) < 2000
    return False


@pytest.mark.parametrize("name", COUNTS)
def test_damaged_files_are_read_rightly_or_refused_in_one_line(
    name: str, room: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    accepted = sum(handled(KINDS[name].try_one, seed, room) for seed in range(COUNTS[name]))
    assert os.listdir(tmp_path) == []
    assert accepted < COUNTS[name] or name == "page"


@pytest.mark.parametrize(
    "name", [name for name in COUNTS if name not in ("run", "checkpoint", "page", "set")]
)
def test_intact_files_are_accepted(name: str, room: Path) -> None:
    for data in KINDS[name].seeds():
        assert handled(KINDS[name].read, room, data, True) or data.startswith(b"solid")


@pytest.mark.parametrize("name", ["run", "checkpoint", "set"])
def test_an_intact_run_is_accepted(name: str, room: Path) -> None:
    for data in KINDS[name].seeds():
        assert handled(KINDS[name].read, room, data, True)


NAMES = (
    "time_s,u1_pct,u2_pct,u3_pct,u4_pct,u5_pct,u6_pct,u7_pct,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,q7_deg"
)


@pytest.mark.parametrize(
    "data",
    [
        b"",
        NAMES.encode(),
        NAMES.encode() + b"\n",
        b",".join([b"c%d" % k for k in range(100_000)]) + b"\n1\n",
        NAMES.encode() + b"\n" + b"1," * 100_000,
        NAMES.encode() + b"\n" + b"9" * 10_000_000,
        b'"' * 99_999 + b"\n" + b'"' * 99_999,
        NAMES.encode() + b'\n"' + b"\n" * 300_000,
        NAMES.encode() + b"\n" + b"\n".join(b"%d" % k + b",0" * 14 for k in range(20_000)),
        NAMES.encode() + b"\n" + b"\n".join(b"%de300" % k + b",1e308" * 14 for k in range(200)),
        bytes(range(256)) * 4000,
        b"\xff\xfe" + b"\x00" * 1001,
        b"time_s\0,u1_pct\n0,0\n",
    ],
)
def test_hostile_logs_are_refused_at_once(room: Path, data: bytes) -> None:
    started = time.perf_counter()
    assert not handled(read_a_log, room, data, True)
    assert time.perf_counter() - started < 10


CELLS = st.floats().map(repr) | st.floats(-99, 99).map(lambda x: f"{x:.3f}") | st.text(max_size=6)


@settings(max_examples=60, deadline=None, derandomize=True)
@given(
    st.lists(st.lists(CELLS, min_size=15, max_size=15), max_size=4), st.sampled_from(",;\t"), st.booleans()
)
def test_logs_of_any_cells(room: Path, rows: list[list[str]], separator: str, header: bool) -> None:
    names = KINDS["log"].seeds()[0].decode().splitlines()[0].split(",")
    lines = [separator.join(row) for row in ([names] if header else []) + rows]
    handled(read_a_log, room, "\n".join(lines).encode("utf-8", "surrogatepass"), True)


LEAVES = (
    st.none()
    | st.booleans()
    | st.integers()
    | st.floats()
    | st.text(max_size=8)
    | st.sampled_from(["a", "[", "&a"])
)
TREES = st.recursive(
    LEAVES, lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=6), inner)
)


@settings(max_examples=60, deadline=None, derandomize=True)
@given(st.sampled_from(sorted(FitSettings.model_fields)), TREES)
def test_settings_of_any_value(room: Path, key: str, value: object) -> None:
    import yaml

    text = GAIN + yaml.safe_dump({key: value}) if key != "parameters" else yaml.safe_dump({key: value})
    handled(read_a_config, room, text.encode("utf-8", "surrogatepass"), False)


@settings(max_examples=60, deadline=None, derandomize=True)
@given(st.text(max_size=30))
def test_overrides_values_and_pages_of_any_text(room: Path, text: str) -> None:
    data = text.encode("utf-8", "surrogatepass")
    handled(read_an_override, room, data, False)
    handled(read_values, room, data, False)
    handled(read_a_page, room, data, False)


@pytest.mark.parametrize(
    ("text", "value"),
    [("010", 10), ("1e3", 1000.0), ("-1.5e-3", -0.0015), ("yes", "yes"), ("1:30", "1:30"), ("0x10", "0x10")],
)
def test_numbers_are_read_as_they_are_meant(text: str, value: object) -> None:
    found = read_document(f"a: {text}", "f")[0]["a"]
    assert found == value
    assert type(found) is type(value)


LAUGHS = "a0: &a0 [x]\n" + "".join(f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 9)}]\n" for i in range(1, 12))


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (LAUGHS, "more than 20000 values"),
        ("a: &a [*a]", "nested more than 40 deep"),
        ("[" * 5000, "nested too deeply"),
        ("1: a\n01: b", "line 2: 1 stands there twice"),
        ("? [a]\n: b", "line 1: a key must be a plain word"),
        ("a: !!set {b}", "type 'set' is not allowed"),
        ("a: !!python/name:os.system", "is not allowed"),
        ('a: "\\ud800"', "cannot be shown"),
        ('a: "\\0"', "cannot be shown"),
        ("a: \0", "special characters"),
        ("a: b: c", "line 1, column 5"),
        ("a: !!int x", "its type cannot hold"),
    ],
)
def test_yaml_that_is_no_data_is_refused(text: str, says: str) -> None:
    with pytest.raises(SettingsError, match=says) as caught:
        read_document(text, "f.yaml")
    assert str(caught.value).startswith("f.yaml")


def test_a_model_is_copied_with_meshes_of_one_name_and_without_files(tmp_path: Path) -> None:
    """Two folders' `x.stl` stay two meshes, and a mesh may stand in the MJCF itself."""
    settings, arm = basis()
    text = KINDS["model"].seeds()[0].decode()
    for folder, name in (("a", "link1"), ("b", "link2")):
        put(tmp_path / folder / "x.stl", (assets() / "meshes" / f"{name}.stl").read_bytes())
        text = text.replace(f'file="{name}.stl"', f'file="{tmp_path / folder / "x.stl"}"')
    text = text.replace("</asset>", '<mesh name="own" vertex="0 0 0 1 0 0 0 1 0 0 0 1"/></asset>')
    path = put(tmp_path / "model.xml", text.encode())
    log = put(tmp_path / "log.csv", KINDS["log"].seeds()[0])
    RunFolder(tmp_path / "run").begin(
        settings.model_copy(update={"arm": arm.model_copy(update={"model": path})}), [log]
    )
    copied = load_model(tmp_path / "run" / "model" / "arm.xml", arm).compile()
    assert np.array_equal(copied.mesh_vert, load_model(path, arm).compile().mesh_vert)


@pytest.mark.parametrize(
    "change",
    [
        {"search": {"seed": True}},
        {"log": {"delay_s": True}},
        {"outputs": [True]},
        {"payloads": {"a.csv": True}},
        {"parameters": {"K": {"quantity": "gain", "bounds": [False, 2]}}},
        {"objective": {"norm": True}},
    ],
)
def test_true_is_no_number(change: dict[str, object]) -> None:
    whole = {"parameters": {"K": {"quantity": "gain", "fixed": 1.0}}} | change
    with pytest.raises(SettingsError, match="true"):
        validate(whole, FitSettings, "f.yaml")
    with pytest.raises(SettingsError, match=r"f\.yaml: "):
        validate(whole, FitSettings, "f.yaml")
