"""Binary formats: the same bits as the CSV they were made from, and one clear line for
a bad file."""

import sys
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
from log_files import NAMES, assert_same, cells, faults, lines, read, save
from log_formats import BagWriter, matlab, write_mat, write_mat73, write_parquet

import hydroid
from hydroid.errors import LogError
from hydroid.log import FORMATS, Log, open_table
from hydroid.log.binary import BINARY
from hydroid.settings.log import LogSettings

VALUES = cells()
COLUMNS = {name: VALUES[:, k] for k, name in enumerate(NAMES)}
WRITERS = {"mat": write_mat, "mat73": write_mat73, "parquet": write_parquet}


def same(log: Log, tmp_path: Path) -> None:
    assert_same(log, read(save(tmp_path / "plain.csv", lines(VALUES)))[0])


@pytest.mark.parametrize("kind", WRITERS)
def test_the_same_bits_as_the_csv(kind: str, tmp_path: Path) -> None:
    log, findings = read(WRITERS[kind](tmp_path / "log", COLUMNS))
    assert findings == []
    same(log, tmp_path)


def settings(time: str, command: str, angle: str) -> LogSettings:
    names = {"time": time, "command": command, "angle": angle}
    return LogSettings.model_validate(
        {what: {"column": name} for what, name in names.items()}
    )


def test_help_and_page_name_every_format() -> None:
    page, text = Path(__file__).parents[2] / "docs" / "logs.md", hydroid.check.__doc__
    assert FORMATS in str(text)
    assert all(
        name in page.read_text() for name in FORMATS.replace(" and ", ", ").split(", ")
    )


MATRIX = settings("t", "u[{joint}]", "q[{joint}]")
T, U, Q = VALUES[:, 0], VALUES[:, 1:3], VALUES[:, 3:5]
STRUCTS = {
    "matrices": ({"t": T[:, None], "u": U, "q": Q}, MATRIX),
    "rows": ({"t": T[None], "u": U.T, "q": Q.T}, MATRIX),
    "struct": (
        {"rec": {"t": T[:, None], "plant": {"u": U, "q": Q}}},
        settings("rec.t", "rec.plant.u[{joint}]", "rec.plant.q[{joint}]"),
    ),
}


@pytest.mark.parametrize("kind", STRUCTS)
def test_structs_of_matlab(kind: str, tmp_path: Path) -> None:
    from h5py import File
    from scipy.io import savemat

    variables, mapping = STRUCTS[kind]
    savemat(tmp_path / "v5.mat", variables)
    with File(tmp_path / "v73.mat", "w", userblock_size=512) as file:
        for name, value in variables.items():
            matlab(file, name, value)
    for name in ("v5.mat", "v73.mat"):
        log, findings = read(tmp_path / name, mapping)
        assert findings == []
        same(log, tmp_path)


def test_elements_of_cells_count_from_one(tmp_path: Path) -> None:
    """As in Simulink's structure with time, of two signals."""
    from scipy.io import savemat

    savemat(
        tmp_path / "log.mat",
        {"log": {"time": T[:, None], "signals": [{"values": U}, {"values": Q}]}},
    )
    columns = ("log.signals[1].values[{joint}]", "log.signals[2].values[{joint}]")
    log, _ = read(tmp_path / "log.mat", settings("log.time", *columns))
    same(log, tmp_path)


def test_timestamps_in_parquet(tmp_path: Path) -> None:
    import pyarrow

    nanoseconds = (1e9 * T).round().astype(np.int64) + 1_700_000_000 * 10**9
    stamps = pyarrow.array(nanoseconds, pyarrow.timestamp("ns", "UTC"))
    log, _ = read(
        write_parquet(tmp_path / "log.parquet", {**COLUMNS, "time_s": stamps})
    )
    same(log, tmp_path)


def test_lengths_of_time_in_parquet_are_seconds(tmp_path: Path) -> None:
    lengths = (1e6 * T).round().astype("m8[us]")
    log, _ = read(
        write_parquet(tmp_path / "log.parquet", {**COLUMNS, "time_s": lengths})
    )
    same(log, tmp_path)


def test_links_to_nothing_and_arrays_without_a_shape_are_left_alone(
    tmp_path: Path,
) -> None:
    from h5py import Empty, ExternalLink, File, SoftLink

    path = write_mat73(tmp_path / "log.mat", COLUMNS)
    with File(path, "r+") as file:
        file["film"] = SoftLink("/nowhere")
        file["page"] = ExternalLink("nowhere.h5", "/film")
        file["none"] = Empty("f8")
    same(read(path)[0], tmp_path)


def truncated(path: Path) -> Path:
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    return path


def with_kind(path: Path, kind: int) -> Path:
    """A file whose first element of doubles is marked as one of another kind, at which
    scipy crashes."""
    data = write_mat(path, COLUMNS).read_bytes()
    doubles = b"\x09\0\0\0" + np.uint32(8 * len(T)).tobytes()
    assert doubles in data
    path.write_bytes(data.replace(doubles, bytes([kind]) + doubles[1:], 1))
    return path


def links_renamed(path: Path) -> Path:
    """A file with a name changed behind the back of HDF5, whose checksums say so."""
    from h5py import ExternalLink, File

    write_mat73(path, COLUMNS)
    with File(path, "r+") as file:
        # a group of more than eight links has an index with checksums
        for name in ("a", "b", "c", "d", "e", "f"):
            file[f"film_{name}"] = ExternalLink("nowhere.h5", "/film")
    data = path.read_bytes()
    assert b"nowhere.h5" in data
    path.write_bytes(data.replace(b"nowhere.h5", b"another.h5"))
    return path


MATLAB = "cannot be read as a MATLAB file"
BAD = {
    "links renamed by another program": (
        lambda p: links_renamed(p / "log.mat"),
        MATLAB,
    ),
    "numbers of no kind": (
        lambda p: with_kind(p / "log.mat", 186),
        f"{MATLAB} (damaged: an element is of kind 186)",
    ),
    "a matrix in numbers": (
        lambda p: with_kind(p / "log.mat", 14),
        f"{MATLAB} (damaged: an element is of kind 14",
    ),
    "truncated mat": (lambda p: truncated(write_mat(p / "log.mat", COLUMNS)), MATLAB),
    "truncated v7.3": (
        lambda p: truncated(write_mat73(p / "log.mat", COLUMNS)),
        MATLAB,
    ),
    "truncated parquet": (
        lambda p: truncated(write_parquet(p / "a", COLUMNS)),
        "cannot be read as Parquet",
    ),
    "text for .mat": (lambda p: save(p / "log.mat", lines(VALUES)), MATLAB),
    "empty mat": (
        lambda p: write_mat(p / "log.mat", {"note": np.array("x")}),
        "holds no array of numbers",
    ),
    "text in parquet": (
        lambda p: write_parquet(p / "a.parquet", {**COLUMNS, "u1_pct": ["up"] * 80}),
        "row 1, column u1_pct: 'up' is not a number (and 79 more",
    ),
    "no values in parquet": (
        lambda p: write_parquet(
            p / "a.parquet",
            {**COLUMNS, "u1_pct": [*[None] * 9, *COLUMNS["u1_pct"][9:]]},
        ),
        "row 1, column u1_pct: no value is there",
    ),
    "other length": (
        lambda p: write_mat(p / "log.mat", {**COLUMNS, "q2_deg": T[:40]}),
        "column q2_deg: holds 40 values, but column time_s holds 80",
    ),
    "empty": (lambda p: save(p / "a.csv", []), FORMATS),
    "workbook": (
        lambda p: save(p / "a.xlsx", [["PK\3\4\0\0"]]),
        "save the sheet as CSV",
    ),
}


@pytest.mark.parametrize("version", ["v5", "v7.3"])
def test_a_large_variable_that_is_not_used_is_not_unpacked(
    version: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from scipy.io import savemat

    monkeypatch.setattr("hydroid.log.binary.MOST_NUMBERS", 1000)
    columns = {"film": np.zeros(100_000), **COLUMNS}
    path = tmp_path / "log.mat"
    if version == "v5":
        savemat(path, columns, do_compression=True)
    else:
        write_mat73(path, columns)
    log, (left_out,) = read(path)
    assert left_out.what == "film holds more than 1,000 numbers and is left out"
    same(log, tmp_path)


def test_columns_of_parquet_that_are_not_used_are_not_unpacked(tmp_path: Path) -> None:
    """Of 80 rows with a text of 100,000 letters each, which takes the file a few kB."""
    path = write_parquet(
        tmp_path / "log.parquet", {**COLUMNS, "film": ["x" * 100_000] * 80}
    )
    read(path)
    tracemalloc.start()
    try:
        log, _ = read(path)
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert peak < 500_000
    same(log, tmp_path)


def test_first_bytes_count_before_an_ending(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also if the format of the ending stands first in the table."""
    parquet = write_parquet(tmp_path / "log.parquet", COLUMNS)
    path = parquet.rename(tmp_path / "log.mat")
    first = {".mat": BINARY[".mat"]}
    monkeypatch.setattr("hydroid.log.read.BINARY", first | BINARY)
    same(read(path)[0], tmp_path)


def empty_bag(path: Path) -> Path:
    with BagWriter(path, "ros1"):
        return path


@pytest.mark.parametrize("kind", BAD)
def test_a_bad_file_is_refused_in_one_line(kind: str, tmp_path: Path) -> None:
    make, said = BAD[kind]
    (fault,) = faults(make(tmp_path))
    assert said in str(fault)
    assert str(fault).isprintable()


@pytest.mark.parametrize(
    ("write", "package", "extra"),
    [
        (lambda path: write_mat73(path, COLUMNS), "h5py", "mat"),
        (lambda path: write_parquet(path, COLUMNS), "pyarrow", "parquet"),
        (empty_bag, "rosbags", "ros"),
    ],
)
def test_a_missing_package_names_its_extra(
    write, package, extra, tmp_path, monkeypatch
) -> None:
    path = write(tmp_path / "log.bag")
    for name in [name for name in sys.modules if name.partition(".")[0] == package]:
        monkeypatch.setitem(sys.modules, name, None)
    with pytest.raises(
        LogError,
        match=rf"needs the package {package}.*pip install 'hydroid\[{extra}\]'",
    ):
        open_table(path)
