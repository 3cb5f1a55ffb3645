"""Uncertainty of an estimate: derivatives, noise, covariance, unidentifiable directions, profiles."""
