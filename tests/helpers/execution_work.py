"""Functions that tests give to workers; a worker process imports them from here."""

import os
import signal
from pathlib import Path

from hydroid.errors import ModelError


def square(chunk: int) -> int:
    return chunk**2


def process(chunk: int) -> int:
    return os.getpid()


def refuse(chunk: int) -> int:
    raise ModelError(f"has no chunk {chunk}", where="arm.xml", hint="take another")


def fail(chunk: int) -> int:
    return 1 // (chunk - 2)


class KillOnce:
    """Kills its worker at the first try of one chunk; the file tells later tries that it has been."""

    def __init__(self, chunk: int, done: Path) -> None:
        self.chunk, self.done = chunk, done

    def __call__(self, chunk: int) -> int:
        if chunk == self.chunk and not self.done.exists():
            self.done.touch()
            die()
        return square(chunk)


class Poison:
    """Kills every worker that takes one chunk, and counts them."""

    def __init__(self, chunk: int, deaths: Path) -> None:
        self.chunk, self.deaths = chunk, deaths

    def __call__(self, chunk: int) -> int:
        if chunk == self.chunk:
            with self.deaths.open("a") as file:
                file.write("x")
            die()
        return square(chunk)


def die() -> None:
    os.kill(os.getpid(), signal.SIGKILL)
