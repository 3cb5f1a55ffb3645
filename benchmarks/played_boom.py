"""The boom of examples/boom, played command by command: the simulation that made its
logs, in plain equations of its own.

As there, pilots come late and with a lag, and the pump comes up some time after a
command. Without a command it falls back.
"""

import runpy
from typing import Any

import numpy as np
from common import EXAMPLES
from scipy.integrate import solve_ivp

from hydroid.arrays import Array

SCRIPT: dict[str, Any] = runpy.run_path(str(EXAMPLES / "boom" / "make_logs.py"))
TOLERANCES = np.array([1e-7, 1e-7, 1e-7, 10.0, 10.0, 10.0, 1e-9, 1e-8])
RETURN_PRESSURE = 8e5
"""of the chamber that does not carry the load, at rest [Pa]"""


class PlayedBoom:
    """The boom as a machine of one joint.

    names, joints, ends [rad], noise [rad]: as of `stranger.Machine`.
    """

    names = ("boom",)
    joints = 1
    ends = np.radians([[-30.0, 60.0]])
    noise = float(np.radians(SCRIPT["NOISE_DEG"]))

    def play(self, start: Array, period: float, samples: int) -> "BoomRun":
        """Return the boom at rest at an angle [rad], (1,), to be stepped by a period
        [s]."""
        return BoomRun(float(start[0]), period)


class BoomRun:
    """One run of the boom, in steps."""

    def __init__(self, start: float, period: float) -> None:
        self._period = period
        self._state = self._at_rest(start)
        self._commands = list[float]()
        self._demanded = 0.0

    @property
    def angle(self) -> Array:
        """[rad], shape (1,)."""
        return self._state[6:7].copy()

    def hold(self, command: Array) -> None:
        """Hold a command [%], (1,), for a period."""
        self._commands.append(float(command[0]))
        raising, lowering = (self._late(delay) for delay in SCRIPT["PILOT_DELAY"])
        self._demanded = self._demanded + self._period if command[0] else 0.0
        up = self._demanded > SCRIPT["ENGINE_DELAY"]
        asked = 1.0 if up else SCRIPT["IDLE"]
        pilots = max(raising, 0.0) / 100.0, max(-lowering, 0.0) / 100.0
        rates = SCRIPT["slope"](*pilots, asked, -np.inf)
        solved = solve_ivp(
            rates,
            (0.0, self._period),
            self._state,
            "LSODA",
            rtol=1e-6,
            atol=TOLERANCES,
        )
        self._state = solved.y[:, -1]

    def _late(self, delay: float) -> float:
        """The command that acts after a delay [s] now [%]."""
        back = round(delay / self._period)
        return self._commands[-1 - back] if back < len(self._commands) else 0.0

    @staticmethod
    def _at_rest(start: float) -> Array:
        s = SCRIPT
        moment = s["MASS"] * 9.81 * s["CENTRE"] * np.cos(start + s["TILT"])
        load = moment / s["geometry"](start)[1]
        carrying = (load + s["AREA_B"] * RETURN_PRESSURE) / s["AREA_A"]
        line = s["SUPPLY"] * (0.5 + 0.5 * s["IDLE"]) - 1.0
        rest = [0.0, 0.0, s["IDLE"], line, carrying, RETURN_PRESSURE, start, 0.0]
        return np.array(rest)
