"""Populations of arms in, angles out: the only room that steps MuJoCo."""

from hydroid.simulation.mechanical import ArmSimulation
from hydroid.simulation.population import ArmParameters, Response

__all__ = ["ArmParameters", "ArmSimulation", "Response"]
