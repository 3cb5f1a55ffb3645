"""Populations of arms in, angles out: the only package that steps MuJoCo."""

from hydroid.simulation.scenario import Candidates, Response
from hydroid.simulation.simulation import Simulation

__all__ = ["Candidates", "Response", "Simulation"]
