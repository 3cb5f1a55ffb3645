"""Populations of arms in, angles out: the only package that steps MuJoCo."""

from hydroid.simulation.candidates import Candidates, Response
from hydroid.simulation.hydraulic import HydraulicSimulation
from hydroid.simulation.mechanical import MechanicalSimulation

__all__ = ["Candidates", "HydraulicSimulation", "MechanicalSimulation", "Response"]
