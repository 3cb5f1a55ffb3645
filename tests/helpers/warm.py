"""A process that has imported hydroid and forks: commands begin at once, each in a
process of its own that ends as a program does, and that may be killed.

    python warm.py SOCKET serve          # the process
    python -S warm.py SOCKET fit-mech …  # as `hydroid fit-mech …`, here and now

Imports and compiled code take a short command most of its time, and tests of whole runs
are about something else.
"""

import json
import os
import select
import signal
import socket
import subprocess
import sys
import tempfile
from collections.abc import Generator, Sequence
from contextlib import contextmanager
from pathlib import Path


class Command:
    """A command that a warm process has begun, used as a `subprocess.Popen`.

    Args:
        address: of the warm process.
        words: of the command, without `hydroid`.
        cwd: where it runs.
        files: its input, output and errors; without them its errors are kept.
        before: Python that its process runs first.

    Attributes:
        pid: of its process.
        returncode: its exit status, below 0 a signal; None while it runs.
    """

    def __init__(
        self,
        address: str,
        words: Sequence[str],
        cwd: Path,
        files: Sequence[int] = (),
        before: str = "",
    ) -> None:
        self.returncode: int | None = None
        self._errors = tempfile.TemporaryFile("w+")  # noqa: SIM115  # lives as long
        asked = {"words": [*words], "cwd": str(cwd), "before": before}
        asked["env"] = dict(os.environ)
        self._line = socket.socket(socket.AF_UNIX)
        self._line.connect(address)
        with Path(os.devnull).open("r+") as nothing:
            kept = (nothing.fileno(), nothing.fileno(), self._errors.fileno())
            socket.send_fds(self._line, [b"+"], files or kept)
        self._line.sendall(json.dumps(asked).encode())
        self._line.shutdown(socket.SHUT_WR)
        self._told = self._line.makefile()
        self.pid = int(self._told.readline())

    def poll(self) -> int | None:
        """Return the exit status, or None while it runs."""
        if self.returncode is None and select.select([self._line], [], [], 0)[0]:
            self.wait()
        return self.returncode

    def send_signal(self, number: int) -> None:
        """Send a signal, if it still runs."""
        if self.poll() is None:
            os.kill(self.pid, number)

    def wait(self) -> int:
        """Wait until it has ended, and return its exit status."""
        if self.returncode is None:
            self.returncode = int(self._told.readline())
            self._line.close()
        return self.returncode

    def communicate(self, timeout: float) -> tuple[str, str]:
        """Wait until it has ended, and return nothing and its errors."""
        if self.returncode is None:
            assert select.select([self._line], [], [], timeout)[0], "it does not end"
        self.wait()
        self._errors.seek(0)
        return "", self._errors.read()


@contextmanager
def warm_process() -> Generator[str]:
    """Start a warm process, and yield its address."""
    helpers = Path(__file__).parent
    paths = [str(helpers), str(helpers.parents[1]), os.environ.get("PYTHONPATH", "")]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, paths))}
    # the address of a socket may have 100 characters
    with tempfile.TemporaryDirectory() as folder:
        address = f"{folder}/warm"
        process = subprocess.Popen(
            [sys.executable, __file__, address, "serve"],
            env=environment,
            stdout=subprocess.PIPE,
            text=True,
        )
        try:
            assert process.stdout is not None
            assert process.stdout.readline() == "ready\n"
            yield address
        finally:
            process.kill()
            process.communicate()


def warm_up() -> None:
    """Fit both stages to a piece of a log."""
    from log_files import head

    import hydroid
    from hydroid.viewer import choose_platform

    # MuJoCo asks for OpenGL when it is imported
    choose_platform()
    settings = {
        "search.algorithm": "ga",
        "search.ga": {"population": 4, "generations": 1},
        "refinement.iterations": 1,
        # a thread would not be there in a process that is forked
        "simulation.threads": 1,
    }
    with tempfile.TemporaryDirectory() as folder:
        log = head(Path(folder) / "log.csv", 300)
        hydroid.fit_mech(log, set=settings, out=f"{folder}/mech")
        hydroid.fit_hyd(log, mech=f"{folder}/mech", set=settings, out=f"{folder}/hyd")


def serve(address: str) -> None:
    """Begin commands until this process is killed; return in the process of each."""
    listener = socket.socket(socket.AF_UNIX)
    listener.bind(address)
    listener.listen()
    # nobody waits for those that watch a command
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)
    print("ready", flush=True)
    while True:
        line, _ = listener.accept()
        _, files, *_ = socket.recv_fds(line, 1, 3)
        if os.fork() == 0:
            listener.close()
            signal.signal(signal.SIGCHLD, signal.SIG_DFL)
            return begin(line, files)
        for file in files:
            os.close(file)
        line.close()


def begin(line: socket.socket, files: Sequence[int]) -> None:
    """Fork the process of a command, and watch it; return in that process."""
    with line.makefile() as asking:
        asked = json.load(asking)
    pid = os.fork()
    if pid:
        # a pipe's reader waits for all that hold its other end
        for file in (*files, 0, 1, 2):
            os.close(file)
        _, status = os.waitpid(pid, 0)
        line.sendall(f"{os.waitstatus_to_exitcode(status)}\n".encode())
        os._exit(0)
    for number, file in enumerate(files):
        os.dup2(file, number)
        os.close(file)
    os.chdir(asked["cwd"])
    os.environ.clear()
    os.environ.update(asked["env"])
    sys.argv = ["hydroid", *asked["words"]]
    # what those that began this process ignore, as under nohup, a command would too
    signal.signal(signal.SIGHUP, signal.SIG_DFL)
    signal.signal(signal.SIGINT, signal.default_int_handler)
    exec(asked["before"], {})
    line.sendall(f"{os.getpid()}\n".encode())
    line.close()


if __name__ == "__main__":
    address, *words = sys.argv[1:]
    if words != ["serve"]:
        sys.exit(Command(address, words, Path.cwd(), (0, 1, 2)).wait())
    warm_up()
    serve(address)
    from hydroid.__main__ import main

    main()
