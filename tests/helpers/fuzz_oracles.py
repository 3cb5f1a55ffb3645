"""Readers that share nothing with hydroid's: what a file that was accepted must have meant."""

import codecs
import csv
import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import yaml

from hydroid.log import Log

TURN = 2 * np.pi


class Wrong(AssertionError):
    """A file was accepted and read as something that it does not say."""


def expect(holds: object, what: str) -> None:
    if not holds:
        raise Wrong(what)


def check_log_reading(data: bytes, log: Log, joints: int, period: float = 0.01) -> None:
    """The default layout: time_s, u1_pct.., q1_deg.. in [s], [%], [deg]."""
    names, rows = _table(data)
    time = _column(names, rows, "time_s")
    keep = np.isfinite(time)
    expect(keep.all() and (np.diff(time) > 0).all(), "time is not finite and increasing")
    grid = period * np.arange(len(log.time))
    expect(np.array_equal(log.time, grid), "time is not the grid")
    expect(abs(time[-1] - time[0] - grid[-1]) < period * 1.02, "the record's length is lost")
    on_grid = len(time) == len(grid) and (np.abs(time - time[0] - grid) <= 0.0101 * period).all()
    at = grid if on_grid else time - time[0]
    for joint in range(joints):
        u, q = (
            _column(names, rows, f"u{joint + 1}_pct"),
            _column(names, rows, f"q{joint + 1}_deg") * np.pi / 180,
        )
        expect(
            (np.abs(u) <= 100 + 1e-5).all() and np.isfinite(q).all(),
            f"joint {joint + 1} is outside or not finite",
        )
        index = np.searchsorted(at, grid + 1e-6 * period, side="right") - 1
        held = np.clip(u[index], -100, 100)
        expect(
            np.allclose(log.command[:, joint], held, rtol=1e-12, atol=1e-12), f"command {joint + 1} differs"
        )
        if joint == 5:
            q = np.unwrap(q)  # the shipped arm's only joint without stops
        line = np.interp(grid, at, q)
        difference = log.angle[:, joint] - line
        if joint == 5:
            difference = difference - TURN * np.rint(difference / TURN)
        expect(np.allclose(difference, 0, atol=1e-9), f"angle {joint + 1} differs")


def _table(data: bytes) -> tuple[list[str], list[list[str]]]:
    wide = data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
    try:
        text = data.decode("utf-16" if wide else "utf-8-sig")
    except UnicodeDecodeError:
        text = data.decode("latin-1")
    lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    if lines[0].startswith("sep="):
        lines = lines[1:]
    lines = [line for line in lines if line.strip(" \t,;|") and not line.strip(" \t,;").startswith("#")]
    for separator in ",;\t|":
        names = [name.strip() for name in next(csv.reader([lines[0]], delimiter=separator))]
        if "time_s" in names:
            rows = [next(csv.reader([line], delimiter=separator)) for line in lines[1:]]
            decimal = "." if separator == "," else ","
            return names, [[cell.replace(decimal, ".") for cell in row] for row in rows]
    raise Wrong("no separator gives a column time_s")


def _column(names: list[str], rows: list[list[str]], name: str) -> np.ndarray:
    expect(names.count(name) == 1, f"{names.count(name)} columns {name}")
    where = names.index(name)
    try:
        return np.array([float(row[where]) for row in rows])
    except (ValueError, IndexError):
        raise Wrong(f"a cell of {name} is no number") from None


def check_settings(text: str, taken: Mapping[str, Any], defaults: Mapping[str, Any]) -> None:
    """What the file says stands in the settings, and what it does not say is as by default.

    The file is read as text throughout (PyYAML's BaseLoader), so that no reader's idea of types matters.
    """
    given = yaml.load(text.removeprefix("\ufeff"), Loader=yaml.BaseLoader)
    if isinstance(given.get("objective"), dict) and "segments" in given["objective"]:
        inner = {
            k: v for k, v in defaults["objective"].items() if k != "segments"
        }  # one of three: no defaults
        defaults = {**defaults, "objective": inner}
    _compare(given, taken, defaults, "")


def _compare(given: Any, taken: Any, default: Any, where: str) -> None:
    if isinstance(taken, Mapping) and isinstance(given, Mapping):
        by_name = {str(key): value for key, value in taken.items()}
        for key, value in given.items():
            name = str(int(key)) if key.lstrip("+-").isdigit() else key
            expect(name in by_name, f"{where}.{key} is lost")
            inner = default.get(name) if isinstance(default, Mapping) else None
            _compare(value, by_name[name], inner, f"{where}.{key}")
        if isinstance(default, Mapping):
            for name in by_name.keys() - {*map(str, given)}:
                if name in default:
                    expect(by_name[name] == default[name], f"{where}.{name} is not as by default")
    elif isinstance(given, list):
        expect(isinstance(taken, list | tuple) and len(taken) == len(given), f"{where}: the list differs")
        for number, (one, other) in enumerate(zip(given, taken, strict=True)):
            _compare(one, other, None, f"{where}[{number}]")
    elif isinstance(taken, list) and len(taken) == 1:
        _compare(given, taken[0], None, where)  # a lone name may stand for a list of one
    else:
        expect(same(given, taken), f"{where}: {given!r} was read as {taken!r}")


def same(text: Any, value: Any) -> bool:
    """Whether a scalar's text means the value."""
    if isinstance(value, Mapping):  # a joint that is null has no columns at all
        return text in ("", "~", "null", "Null", "NULL") and not any(value.values())
    if not isinstance(text, str):
        return False
    if isinstance(value, bool):
        return text.lower() in (
            ("true", "yes", "on", "y", "t", "1", "+1")
            if value
            else ("false", "no", "off", "n", "f", "0", "-0", "+0")
        )
    if value is None:
        return text in ("", "~", "null", "Null", "NULL")
    if isinstance(value, int | float):
        try:
            number = float(text.strip())
        except ValueError:
            return False
        return math.isclose(number, value, rel_tol=1e-15, abs_tol=0.0)
    return text == value or (value == "inf" and text.strip("+.").lower() == "inf")


def check_mesh(data: bytes, volume: float, centre: np.ndarray, inertia: np.ndarray) -> None:
    """Volume, centre and inertia of a binary STL by tetrahedra to the origin."""
    count = int.from_bytes(data[80:84], "little")
    expect(len(data) >= 84 + 50 * count, "shorter than its number of faces")
    faces = np.frombuffer(data[84 : 84 + 50 * count], np.uint8).reshape(count, 50)[:, 12:48].copy()
    corners = faces.view("<f4").reshape(count, 3, 3).astype(float)
    expect(np.isfinite(corners).all(), "a corner is not finite")
    det = np.linalg.det(corners)
    total = det.sum() / 6
    mean = (det[:, None] / 24 * corners.sum(axis=1)).sum(axis=0) / total
    # second moments of a tetrahedron with one corner at 0: det / 120 (sum of v v' + s s')
    s = corners.sum(axis=1)
    second = np.einsum("f,fvi,fvj->ij", det / 120, corners, corners) + np.einsum(
        "f,fi,fj->ij", det / 120, s, s
    )
    second = second / total - np.outer(mean, mean)
    tensor = np.trace(second) * np.eye(3) - second
    size = np.ptp(corners.reshape(-1, 3), axis=0).max()
    reach = max(size, np.abs(corners).max())
    expect(math.isclose(volume, total, rel_tol=1e-6, abs_tol=1e-12 * reach**3), f"volume {volume} is {total}")
    expect(np.allclose(centre, mean, atol=1e-5 * reach), "centre differs")
    expect(np.allclose(inertia, tensor, atol=1e-4 * reach**2), "inertia differs")
