"""Problems whose residuals are linear in their parameters: other libraries say what is right."""

import numpy as np
from scipy.signal import lfilter

from hydroid.parameters import Parameter, ParameterSet
from hydroid.problem.channels import Channel
from hydroid.problem.priors import Priors
from hydroid.settings.fit import FitSettings
from hydroid.settings.problem import ParameterSettings, PriorSettings

DEG = np.deg2rad(1.0)
AR1 = np.exp(-0.01 / 0.15)  # correlation time 0.15 s at 100 Hz


class Linear:
    """A problem whose residuals are linear in its parameters: y - X theta, channel after channel."""

    def __init__(self, columns, measured, theta, *, fixed=(), known=None, unit=1.0, weights=(1.0,), **more):
        self.columns, self.measured, self.simulated = columns, measured, 0
        self.leaves_start_open = self.afar = False
        names = "abcdefgh"[: len(theta)]
        self.parameters = ParameterSet(
            tuple(
                Parameter(n, "kg", -9 * abs(t) * unit, 11 * abs(t) * unit, t * unit if n in fixed else None)
                for n, t in zip(names, theta, strict=True)
            )
        )
        self.unit = unit
        one = ParameterSettings(quantity="gain", bounds=(0.1, 1.0))
        how = {"segments": 1} | more
        self.settings = FitSettings(parameters=dict.fromkeys(names, one), objective=how)
        statements = {k: PriorSettings(**v) for k, v in (known or {}).items()}
        self.priors = Priors(statements, self.parameters)
        edges = np.linspace(0, len(measured), len(weights) + 1).astype(int)
        self.channels = tuple(
            Channel(i, 2, "angle", 0, measured[a:b], w, slice(a, b))
            for i, (a, b, w) in enumerate(zip(edges[:-1], edges[1:], weights, strict=True))
        )
        self.weight = np.repeat(weights, np.diff(edges))

    def unfiltered(self, residuals):
        return residuals

    def residuals(self, theta):
        self.simulated += len(theta)
        return self.weight * (self.measured - theta / self.unit @ self.columns)


def slow(count, samples=1000, seed=0):
    rng = np.random.default_rng(seed)
    return np.cumsum(rng.normal(size=(count, samples)), axis=1) / np.sqrt(samples)


def ar1(rng, samples, phi, level):
    steps = rng.normal(0, level * np.sqrt(1 - phi**2), samples)
    steps[0] = rng.normal(0, level)
    return lfilter([1.0], [1.0, -phi], steps)


def least_squares(columns, measured):
    return np.linalg.lstsq(columns.T, measured)[0]


THETA = np.array([1.0, -2.0, 3.0])
