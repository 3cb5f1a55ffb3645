"""Populations of arms in, angles out: the only room that steps MuJoCo."""

from hydroid.simulation.hydraulic import HydraulicSimulation
from hydroid.simulation.mechanical import MechanicalSimulation
from hydroid.simulation.population import ArmParameters, Candidates, Response

__all__ = ["ArmParameters", "Candidates", "HydraulicSimulation", "MechanicalSimulation", "Response"]
