"""Populations of arms in, angles out: the only package that steps MuJoCo."""

from hydroid.simulation.hydraulic import HydraulicSimulation
from hydroid.simulation.mechanical import MechanicalSimulation
from hydroid.simulation.scenario import Candidates, Response

__all__ = ["Candidates", "HydraulicSimulation", "MechanicalSimulation", "Response"]
