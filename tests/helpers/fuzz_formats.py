"""Files of arrays and bags for `fuzz`: intact ones of every format, with odd columns,
and what reads them."""

import datetime
import signal
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory
from typing import Any

import h5py
import numpy as np
import pyarrow
from fuzz import Kind, damage, logs
from log_formats import BagWriter, matlab, write_mat, write_mat73
from pyarrow import parquet
from scipy.io import savemat

LONGEST = 20  # [s], for a file of some kB
# [bytes], of libraries and their arenas, beside four times the file
SPARE = 150_000_000
BAG = (
    "--set=log.command.column=/valves.data[{joint}]",
    "--set=log.angle.column=/joints.position[{joint}]",
    "--set=log.angle.unit=rad",
)


@contextmanager
def bounded(size: int) -> Generator[None]:
    """Refuse a body that takes too long, or more memory than four times `size` [bytes]
    and a spare."""

    def late(*_: object) -> None:
        raise AssertionError(f"is not read after {LONGEST} s")

    before = _peak(anew=True)
    previous = signal.signal(signal.SIGALRM, late)
    signal.alarm(LONGEST)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, previous)
    grown = _peak() - before
    assert grown < 4 * size + SPARE, f"takes {grown / 1e6:.0f} MB of memory"


def _peak(*, anew: bool = False) -> int:
    """Return the most memory that this process has held [bytes]; `anew`: from now
    on."""
    if anew:
        Path("/proc/self/clear_refs").write_text("5")
    status = Path("/proc/self/status").read_text()
    lines = (line.split() for line in status.splitlines())
    return next(1024 * int(line[1]) for line in lines if line[0] == "VmHWM:")


def columns() -> dict[str, np.ndarray]:
    """Return a short log by column."""
    names, *rows = (line.split(",") for line in logs()[1].decode().splitlines())
    return dict(zip(names, np.array(rows, float).T, strict=True))


def odd_columns() -> Iterator[dict[str, np.ndarray]]:
    """Yield logs with one column that loggers rarely write."""
    plain = columns()
    rows = len(plain["time_s"])
    yield from [plain] * 20  # damaged ones of these are read further
    for name in ("time_s", "q2_deg", "u2_pct"):
        one = plain[name]
        yield plain | {name: one.astype(np.int8)}
        yield plain | {name: one > 0}
        yield plain | {name: one.astype(np.float32)}
        yield plain | {name: np.where(one > one.mean(), np.nan, one)}
        yield plain | {name: np.where(one > one.mean(), 1e308, one)}
        yield plain | {name: np.full(rows, np.inf)}
        yield plain | {name: one[:1]}
        yield plain | {name: np.full(rows, -(2**63))}
        yield {key: values for key, values in plain.items() if key != name}


@cache
def mats() -> tuple[bytes, ...]:
    """Files of MATLAB 4 to 7: plain, compressed, with structs, cells, text, complex and
    sparse numbers."""
    plain = columns()
    files = [_written(write_mat, one) for one in odd_columns()]
    odd = [
        {"rec": plain},
        {"rec": {"inner": list(plain.values())}},
        plain
        | {
            "note": "a rig",
            "more": np.array(["a", "b"], object),
            "z": 1j * plain["q2_deg"],
        },
        plain
        | {
            "grid": np.zeros((3, 4, 5)),
            "none": np.zeros((0, 3)),
            "q2_deg": 1j * plain["q2_deg"],
        },
    ]
    files += [_written(write_mat, one) for one in odd]
    for options in ({"do_compression": True}, {"format": "4"}):
        files.append(
            _written(
                lambda path, one, options=options: savemat(path, one, **options), plain
            )
        )
    return tuple(files)


@cache
def mats73() -> tuple[bytes, ...]:
    return (
        *(_written(write_mat73, one) for one in odd_columns()),
        _written(_write_struct73, columns()),
    )


def _write_struct73(path: Path, content: dict[str, np.ndarray]) -> None:
    with h5py.File(path, "w", userblock_size=512) as file:
        matlab(file, "rec", content)
    data = path.read_bytes()
    path.write_bytes(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(512) + data[512:])


@cache
def parquets() -> tuple[bytes, ...]:
    """Parquet files: plain, compressed, with text, times, lengths of time, decimals,
    lists and structs."""
    plain = columns()
    rows = len(plain["time_s"])
    now = datetime.datetime(2026, 3, 1, 23, 59)
    since = [datetime.timedelta(seconds=one) for one in plain["time_s"].tolist()]
    odd = {
        "stamps": [now + one for one in since],
        "lengths": since,
        "texts": [f"{one:g}" for one in plain["q2_deg"]],
        "words": ["up"] * rows,
        "bytes": [b"\xff\x00"] * rows,
        "none": [None] * rows,
        "lists": [[1.0, 2.0]] * rows,
        "structs": [{"a": 1.0}] * rows,
        "dates": [now.date()] * rows,
        "choices": pyarrow.array((["a", "b"] * rows)[:rows]).dictionary_encode(),
    }
    tables = [
        pyarrow.table(plain | odd),
        pyarrow.table(plain).slice(0, 0),
        pyarrow.table({}),
    ]
    for name in ("time_s", "q2_deg", "u2_pct"):
        tables += [pyarrow.table(plain | {name: values}) for values in odd.values()]
        tables += [pyarrow.table(plain).append_column(name, pyarrow.array(plain[name]))]
    for one in odd_columns():
        if len({len(values) for values in one.values()}) == 1:
            tables.append(pyarrow.table(one))
    files = [
        _written(lambda path, one: parquet.write_table(one, path), one)
        for one in tables
    ]
    for options in (
        {"compression": "none"},
        {"compression": "zstd"},
        {"use_dictionary": False},
    ):

        def write(path: Path, one: object, options: Any = options) -> None:
            parquet.write_table(one, path, **options)

        files.append(_written(write, tables[0]))
    return tuple(files)


def _written(write: Callable[[Path, object], object], content: object) -> bytes:
    with TemporaryDirectory() as folder:
        path = Path(folder) / "log"
        write(path, content)
        (file,) = Path(folder).iterdir()  # a library may add its ending
        return file.read_bytes()


@cache
def bag(kind: str) -> dict[str, bytes]:
    """Return the files of a bag of a second, by ending: of a folder, its database and
    metadata."""
    plain = columns()
    angles = np.stack([plain[f"q{joint}_deg"] for joint in range(1, 8)], axis=1)
    commands = np.stack([plain[f"u{joint}_pct"] for joint in range(1, 8)], axis=1)
    with TemporaryDirectory() as folder:
        path = Path(folder) / ("log.bag" if kind == "ros1" else "log")
        with BagWriter(path, kind) as writer:
            for k, at in enumerate(1e9 + plain["time_s"]):
                writer.write(
                    "/joints", at, writer.joints(at, [], np.radians(angles[k]))
                )
                writer.write("/valves", at, writer.array(commands[k].copy()))
        files = [path] if path.is_file() else path.iterdir()
        return {file.suffix: file.read_bytes() for file in files}


def overwritten(rng: Random, data: bytes) -> bytes:
    """Damage bytes where they stand, so that offsets stay right; one time in four in
    any way."""
    if rng.random() < 0.25:
        return damage(rng, data)
    out = bytearray(data)
    for _ in range(rng.choice((1, 1, 2, 8))):
        width = rng.choice((1, 1, 2, 4, 8))
        value = rng.choice(
            (b"\0" * width, b"\xff" * width, b"\x7f" * width, rng.randbytes(width))
        )
        # lengths and names stand at both ends
        near = rng.choice(
            (len(data), len(data), min(len(data), 1000), -min(len(data), 3000))
        )
        at = rng.randrange(near) if near > 0 else len(data) - rng.randrange(-near)
        out[at : at + width] = value[: len(data) - at]
    return bytes(out)


def _check(place: str, *more: str) -> Callable[[Path, bytes], Sequence[str]]:
    return lambda room, _: ("check", str(room / place), *more)


def _ros2(room: Path, data: bytes) -> Sequence[str]:
    """Complete the folder of a bag by the file that is not damaged."""
    for name, content in {
        "log.db3": bag("ros2")[".db3"],
        "metadata.yaml": bag("ros2")[".yaml"],
    }.items():
        if not (room / "log" / name).exists():
            (room / "log" / name).write_bytes(content)
    return ("check", str(room / "log"), *BAG)


FORMATS = {
    kind.name: kind
    for kind in (
        Kind("mat", mats, "log.mat", _check("log.mat"), damaged=overwritten),
        Kind("mat73", mats73, "log.mat", _check("log.mat"), damaged=overwritten),
        Kind(
            "parquet",
            parquets,
            "log.parquet",
            _check("log.parquet"),
            damaged=overwritten,
        ),
        Kind(
            "ros1",
            lambda: (bag("ros1")[".bag"],),
            "log.bag",
            _check("log.bag", *BAG),
            damaged=overwritten,
        ),
        Kind(
            "ros2",
            lambda: (bag("ros2")[".db3"],),
            "log/log.db3",
            _ros2,
            damaged=overwritten,
        ),
        Kind(
            "ros2 metadata", lambda: (bag("ros2")[".yaml"],), "log/metadata.yaml", _ros2
        ),
        Kind(
            "mcap",
            lambda: (bag("mcap")[".mcap"],),
            "a.mcap",
            _check("a.mcap", *BAG),
            damaged=overwritten,
        ),
    )
}
