"""hydroid: physical parameters of a hydraulic manipulator from its logs, on MuJoCo."""

__version__ = "0.1.0"
