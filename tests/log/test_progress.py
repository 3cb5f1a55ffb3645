"""Long files report how much of them is read."""

from pathlib import Path

import numpy as np
import pytest
from field_logs import make_truth, table, text
from log_files import NAMES
from log_formats import BagWriter

from hydroid.log import open_table
from hydroid.project.project import write_project


def test_a_long_csv_reports_megabytes(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    row = ",".join(["0.123456789"] * len(NAMES)) + "\n"
    path.write_text(",".join(NAMES) + "\n" + row * 50_000)
    said = list[tuple[str, float, float]]()
    open_table(path, progress=lambda *what: said.append(what))
    names, done, totals = zip(*said, strict=True)
    assert {*names} == {"reading log.csv, MB"}
    assert {*totals} == {3}
    assert done == (0, 1, 2)


@pytest.mark.parametrize("kind", ["ros1", "ros2"])
def test_a_bag_reports_messages(
    kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("hydroid.log.bags.WATCHED", 100)
    path = tmp_path / ("log.bag" if kind == "ros1" else "log")
    with BagWriter(path, kind) as bag:
        for k in range(585):
            bag.write("/valves", 1e9 + 0.01 * k, bag.array(np.zeros(2)))
    said = list[tuple[str, float, float]]()
    open_table(path, progress=lambda *what: said.append(what))
    assert [done for _, done, _ in said] == [0, 100, 200, 300, 400, 500]
    assert {total for *_, total in said} == {585}


def test_init_reports_what_it_reads_and_fits(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text(text(table(make_truth((70, -60, 100)))))
    said = list[tuple[str, int, int]]()
    write_project(tmp_path / "mine", None, [path], [], lambda *what: said.append(what))
    assert ("reading log.csv, MB", 0, 0) in said
    assert ("finding starts of valves: joint", 1, 2) in said
