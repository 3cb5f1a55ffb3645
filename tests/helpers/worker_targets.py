"""What tests send to workers; a worker process imports it from here."""

import os
import signal
from pathlib import Path
from typing import Any

import numpy as np

from hydroid.errors import ModelError

NINE = np.arange(18.0).reshape(9, 2)
DEADLY = 1e-3
"""first value of a candidate that kills its worker"""


class Rows:
    def squares(self, theta: np.ndarray) -> np.ndarray:
        return theta**2

    def process(self, theta: np.ndarray) -> np.ndarray:
        return np.full((len(theta), 1), float(os.getpid()))

    def refused(self, theta: np.ndarray) -> np.ndarray:
        raise ModelError("has no such joint", where="arm.xml", hint="take another")

    def failed(self, theta: np.ndarray) -> np.ndarray:
        return theta[:, [99]]


class Deadly:
    """Passes a method on, but a DEADLY candidate kills the worker, at most `times`;
    each death is counted."""

    def __init__(self, target: Any, deaths: Path, times: int = 99) -> None:
        self.target, self.deaths, self.times = target, deaths, times

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)

        def call(theta: np.ndarray) -> np.ndarray:
            died = len(self.deaths.read_text()) if self.deaths.exists() else 0
            if np.any(theta[:, 0] == DEADLY) and died < self.times:
                with self.deaths.open("a") as file:
                    file.write("x")
                os.kill(os.getpid(), signal.SIGKILL)
            return getattr(self.target, name)(theta)

        return call
