"""MuJoCo without its warnings on the terminal and its MUJOCO_LOG.TXT in the working folder."""

import warnings
from collections.abc import Generator
from contextlib import contextmanager

import mujoco


@contextmanager
def quiet_mujoco() -> Generator[None]:
    """Keep MuJoCo from printing a warning for every diverged candidate, and from writing MUJOCO_LOG.TXT."""
    before = mujoco.MjLogConfig.get()
    silent = mujoco.MjLogConfig.get()
    silent.logto_console = False
    silent.logto_file = False
    mujoco.MjLogConfig.set(silent)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # MuJoCo's own, of the same things
            yield
    finally:
        mujoco.MjLogConfig.set(before)
