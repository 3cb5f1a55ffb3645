"""Which Dask scheduler hydroid uses: its own on this machine, or one that runs already.

A Dask scheduler runs whatever code reaches its port. The one that is started here
therefore uses TLS with credentials made for the run, and refuses clients and workers
without them. A scheduler that was started elsewhere needs TLS too, with the credentials
of Dask's configuration, unless it listens on the loopback interface. `python -m
hydroid.parallel.cluster FOLDER` makes credentials for a scheduler and workers that a
script starts, as examples/cluster/dask.sbatch does.
"""

import ipaddress
import json
import logging
import os
import re
import signal
import sys
import warnings
from collections.abc import Generator
from contextlib import ExitStack, contextmanager, suppress
from multiprocessing import resource_tracker
from pathlib import Path
from typing import Any

import yaml

from hydroid.errors import RunError, SettingsError
from hydroid.parallel.workers import DaskWorkers

CONNECT = 20.0  # seconds in which a scheduler must answer


@contextmanager
def open_workers(dask: str | None) -> Generator[DaskWorkers | None]:
    """Connect to workers; at the end, stop those that were started here.

    Args:
        dask: `local[:N]` starts N workers on this machine, one per core if N is left
            out; anything else is the address of a scheduler, or its scheduler file.
            None: no workers.

    Raises:
        SettingsError: Dask is not installed, or the address is refused.
        RunError: no scheduler answers.
    """
    if dask is None:
        yield None
        return
    try:
        from dask import config
        from distributed import Client
    except ImportError as error:
        hint = "install it: pip install 'hydroid[cluster]'"
        raise SettingsError(
            f"Dask cannot be imported ({error})", "--dask", hint
        ) from None
    with ExitStack() as stack:
        # HTTP servers of what is started here have no TLS, and serve nothing
        closed = {
            f"distributed.{name}.http.routes": list[str]()
            for name in ("scheduler", "worker")
        }
        stack.enter_context(config.set(closed))
        own = re.fullmatch("local(?::([1-9][0-9]{0,3}))?", dask)
        if own:
            # a worker that dies is started again, and Dask would give it up for good if
            # that takes longer than 15 s, as on a busy machine
            stack.enter_context(
                config.set({"distributed.deploy.lost-worker-timeout": "1 hour"})
            )
            target = _start_local(stack, int(own[1] or os.cpu_count() or 1))
        else:
            target = _address(dask)
        yield DaskWorkers(_connected(stack, Client, target, dask))


def _connected(stack: ExitStack, kind: Any, target: Any, dask: str) -> Any:
    """Return a client of a kind that is connected to a scheduler until the stack
    ends."""
    client: Any = kind.__new__(kind)
    try:
        client.__init__(target, timeout=CONNECT)
    except (OSError, ValueError, TypeError, RuntimeError) as error:
        # a refused client left open is closed when it is collected; in the thread that
        # another waits for, that would wait for the other
        _close(client)
        words = " ".join(str(error).split())
        hint = "check the address; for tls:// name the folder of its credentials in DASK_CONFIG"
        raise RunError(
            f"no Dask scheduler answers ({words})", f"--dask {dask}", hint
        ) from None
    stack.callback(_close, client)
    return client


def write_credentials(folder: Path) -> None:
    """Write new TLS credentials, as a Dask configuration,
    into a new folder that only its user can read.

    Scheduler, workers and hydroid use them where the environment variable DASK_CONFIG
    names the folder. Raises FileExistsError: the folder is there already.
    """
    from distributed.security import Security

    security: Any = Security.temporary()  # pyright: ignore[reportUnknownMemberType]
    tls: dict[str, Any] = {}
    for role in ("scheduler", "worker", "client"):
        role_config = security.get_tls_config_for_role(role)
        tls[role] = {"cert": role_config["cert"], "key": role_config["key"]}
        # all trust one authority
        tls["ca-file"] = role_config["ca_file"]
    comm = {"default-scheme": "tls", "require-encryption": True, "tls": tls}
    # HTTP servers have no TLS, and serve nothing
    closed: dict[str, Any] = {"http": {"routes": []}}
    content = {"distributed": {"comm": comm, "scheduler": closed, "worker": closed}}
    folder.mkdir(mode=0o700)
    (folder / "distributed.yaml").write_text(yaml.safe_dump(content))


def _start_local(stack: ExitStack, count: int) -> Any:
    from distributed import LocalCluster
    from distributed.security import Security

    with _signals_blocked(), warnings.catch_warnings():
        # Dask warns of the port of an HTTP server that serves nothing
        warnings.simplefilter("ignore")
        cluster: Any = LocalCluster(
            n_workers=count,
            threads_per_worker=1,
            memory_limit=0,  # unlimited
            host="127.0.0.1",
            security=Security.temporary(),  # pyright: ignore[reportUnknownMemberType]
            dashboard_address=None,  # pyright: ignore[reportArgumentType]  # documented: none
            silence_logs=logging.CRITICAL,
        )
    stack.callback(_close, cluster)
    return cluster


@contextmanager
def _signals_blocked() -> Generator[None]:
    """Let threads that start in here, and their processes, ignore Ctrl-C and a
    cluster's notice."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    # the tracker would unblock them
    resource_tracker.ensure_running()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT, signal.SIGUSR1})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _address(given: str) -> str:
    """Return the address that is given itself or by a scheduler file, if code may be
    sent there."""
    from distributed.comm.addressing import get_address_host, parse_address

    address = given
    where = f"--dask {given}"
    try:
        if Path(given).is_file():
            address = str(json.loads(Path(given).read_text())["address"])
        elif given.startswith("local:"):
            # local: is not a host of that name
            raise ValueError(given)
        scheme, _ = parse_address(address)
        host = get_address_host(address)
    except (OSError, ValueError, TypeError, KeyError):
        hint = "give local[:N], tls://HOST:PORT, or a scheduler file"
        raise SettingsError("is no Dask scheduler", where, hint) from None
    if scheme != "tls" and not _is_this_machine(host):
        what = "without TLS anyone who reaches it can run code as you"
        raise SettingsError(
            what, where, "start it with TLS as examples/cluster/dask.sbatch does"
        )
    return address


def _is_this_machine(host: str) -> bool:
    """Return whether nobody else can listen to what is sent to a host."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def _close(resource: Any) -> None:
    with suppress(Exception):  # its scheduler may be gone
        resource.close()


if __name__ == "__main__":
    write_credentials(Path(sys.argv[1]))
