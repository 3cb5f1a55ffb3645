"""Two workers on this machine: what they compute, and who is refused."""

import gc
import os
import sys
from collections.abc import Iterator
from pathlib import Path
from urllib.error import HTTPError
from urllib.request import urlopen

import numpy as np
import psutil
import pytest
from spread_problem import arguments, assert_same, random_candidates
from worker_targets import NINE, Rows

from hydroid.errors import ModelError, RunError, SettingsError
from hydroid.parallel import cluster, workers
from hydroid.parallel.cluster import open_workers
from hydroid.parallel.workers import DaskWorkers
from hydroid.problem.problem import Problem

distributed = pytest.importorskip("distributed")


@pytest.fixture(scope="module")
def two() -> Iterator[DaskWorkers]:
    with open_workers("local:2") as opened:
        assert opened is not None
        yield opened


def opened(dask: str | None) -> None:
    with open_workers(dask):
        pass


def test_rows_come_in_order_from_several_processes(two: DaskWorkers):
    rows = Rows()
    for theta in (NINE, NINE[:1], NINE[:0]):
        np.testing.assert_array_equal(two(rows, "squares", theta, 2), theta**2)
    processes = set(two(rows, "process", NINE, 1)[:, 0])
    assert len(processes) == two.count == 2
    assert os.getpid() not in processes


@pytest.mark.parametrize("config", ["article-mech", "article-hyd"])
def test_workers_change_no_bit(two: DaskWorkers, config: str):
    settings, logs = arguments(config)
    plain, spread = Problem(settings, logs), Problem(settings, logs, two)
    theta = random_candidates(plain, 9)
    if config == "article-mech":
        assert np.isinf(plain.evaluate(theta)[:, -1]).tolist() == [False] * 8 + [True]
    assert_same(spread, plain, theta)


def test_errors_come_through(two: DaskWorkers):
    with pytest.raises(ModelError, match=r"^arm.xml: has no such joint; take another$"):
        two(Rows(), "refused", NINE, 2)
    with pytest.raises(IndexError, match="out of bounds"):
        two(Rows(), "failed", NINE, 2)
    np.testing.assert_array_equal(two(Rows(), "squares", NINE, 2), NINE**2)


def test_workers_of_another_version_are_refused(
    two: DaskWorkers, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(workers, "VERSIONS", workers.VERSIONS | {"mujoco": "0.0"})
    with pytest.raises(RunError, match=r"a Dask worker has mujoco .*, here is 0.0"):
        two(Rows(), "squares", NINE, 2)


def test_only_the_loopback_listens_with_tls_and_no_page_is_served(two: DaskWorkers):
    info = two.client.scheduler_info()
    for address in (info["address"], *info["workers"]):
        assert address.startswith("tls://127.0.0.1:")
    this = psutil.Process()
    sockets = [
        s
        for p in (this, *this.children(recursive=True))
        for s in p.net_connections("inet")
    ]
    assert {s.laddr.ip for s in sockets if s.status == "LISTEN"} == {"127.0.0.1"}
    for page in ("info/main/workers.html", "json/counts.json", "status"):
        with pytest.raises(HTTPError, match="404"):
            urlopen(f"http://127.0.0.1:{info['services']['dashboard']}/{page}")


def test_a_foreign_client_is_refused(two: DaskWorkers, monkeypatch: pytest.MonkeyPatch):
    """Without credentials, with those of another run, and without TLS."""
    address = two.client.scheduler_info()["address"]
    monkeypatch.setattr(cluster, "CONNECT", 2.0)
    with pytest.raises(RunError, match="no Dask scheduler answers"):
        opened(address)
    with pytest.raises(RunError, match="no Dask scheduler answers"):
        opened(address.replace("tls", "tcp"))
    for other in (
        distributed.Security.temporary(),
        distributed.Security(require_encryption=True),
    ):
        with pytest.raises((OSError, TypeError)):
            distributed.Client(address, security=other, timeout=2.0)
        gc.collect()  # it closes here, and not in the thread of the next one
    assert two.count == 2


NO_TLS = (SettingsError, "without TLS anyone ")
NONE = (SettingsError, "no Dask scheduler; give local")
SILENT = (RunError, "no Dask scheduler answers")


@pytest.mark.parametrize(
    ("address", "refusal"),
    [
        *(
            (a, NO_TLS)
            for a in ("tcp://10.0.0.1:8786", "node7:8786", "ws://node7:80", "file.json")
        ),
        *(
            (a, NONE)
            for a in ("local:0", "local:many", "carrier-pigeon://somewhere", "log.csv")
        ),
        *((a, SILENT) for a in ("tcp://127.0.0.1:1", "localhost:1", "tcp://[::1]:1")),
    ],
)
def test_an_address_that_is_none_or_that_others_reach_is_refused(
    address, refusal, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(cluster, "CONNECT", 0.5)
    Path("file.json").write_text('{"address": "tcp://10.0.0.1:8786"}')
    Path("log.csv").write_text("t,u\n")
    with pytest.raises(refusal[0], match=refusal[1]):
        opened(address)


def test_no_workers_and_no_dask(monkeypatch: pytest.MonkeyPatch):
    with open_workers(None) as nothing:
        assert nothing is None
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(SettingsError, match=r"pip install 'hydroid\[cluster\]'"):
        opened("local")
