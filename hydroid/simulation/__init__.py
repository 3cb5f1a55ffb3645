"""Populations of arms in, angles out: the only package that steps MuJoCo.

A model of the actuators has its module: today `chain`, the whole chain from command to pressure. Another,
simpler one would read the same quantities of the same `Candidates` and give the same `Response`.
"""

from hydroid.simulation.scenario import Candidates, Response
from hydroid.simulation.simulation import Simulation

__all__ = ["Candidates", "Response", "Simulation"]
