"""Populations of arms in, angles out: the only package that steps MuJoCo."""

from hydroid.simulation.scenario import Candidates, Response
from hydroid.simulation.simulation import Simulation, make_scenario, make_simulation

__all__ = [
    "Candidates",
    "Response",
    "Simulation",
    "make_scenario",
    "make_simulation",
]
