"""Problems whose errors are linear in their parameters: other libraries say what is
right."""

import itertools

import numpy as np
from made_errors import covariance
from scipy.linalg import block_diag
from scipy.signal import lfilter

from hydroid.log import Log
from hydroid.parameters import Parameter, ParameterSet
from hydroid.posterior.error_filter import SHORTEST
from hydroid.posterior.error_model import (
    likelihood_at,
    make_error_model,
    make_likelihood,
)
from hydroid.problem.channels import Channel
from hydroid.problem.priors import Priors
from hydroid.search.axes import SHARED
from hydroid.settings.fit import FitSettings
from hydroid.settings.problem import ParameterSettings, PriorSettings

DEG = np.deg2rad(1.0)
AR1 = np.exp(-0.01 / 0.15)  # correlation time 0.15 s at 100 Hz


class Linear:
    """A problem whose errors are linear in its parameters: y - X theta, log after log,
    100 Hz.

    The joint rests, as its error model sees it: it travels no way, and is at no stop.
    """

    def __init__(
        self,
        columns,
        measured,
        theta,
        *,
        fixed=(),
        known=None,
        unit=1.0,
        logs=1,
        stage="hyd",
        **more,
    ):
        self.columns, self.measured, self.simulated = columns, measured, 0
        names = "abcdefgh"[: len(theta)]
        self.parameters = ParameterSet(
            tuple(
                Parameter(
                    n,
                    "kg",
                    -9 * abs(t) * unit,
                    11 * abs(t) * unit,
                    t * unit if n in fixed else None,
                )
                for n, t in zip(names, theta, strict=True)
            )
        )
        self.unit = unit
        one = ParameterSettings(quantity="damping", bounds=(0.1, 1.0))
        how = {"segments": 1} | more
        self.settings = FitSettings(
            stage=stage,
            parameters=dict.fromkeys(names, one),
            objective=how,
            free_start=False,
        )
        statements = {k: PriorSettings(**v) for k, v in (known or {}).items()}
        self.priors = Priors(statements, self.parameters)
        edges = np.linspace(0, len(measured), logs + 1).astype(int)
        ends = list(itertools.pairwise(edges))
        self.logs = tuple(resting(b - a) for a, b in ends)
        self.channels = tuple(
            Channel(i, 2, "angle", 0, np.zeros(b - a), 1.0, slice(a, b))
            for i, (a, b) in enumerate(ends)
        )

    def started(self, log):
        return [2]

    @property
    def bindings(self):
        return self

    def owners(self):
        return np.full(len(self.parameters.names), SHARED)

    def output_errors(self, theta):
        self.simulated += len(theta)
        return self.measured - theta / self.unit @ self.columns


def resting(samples):
    zeros = np.zeros((samples, 7))
    return Log("rest.csv", np.arange(samples) * 0.01, zeros, zeros, 0.01)


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


def white(deg):
    """NUMBERS of an error that is known to be white noise of so many degrees, (1,
    5)."""
    return np.array([[(deg * DEG) ** 2, 0.0, 0.0, 0.0, SHORTEST]])


def dense_covariance(problem, numbers):
    """Of all errors of a problem, (R, R), by the numbers of its error model."""
    errors = make_error_model(problem)
    return block_diag(*(covariance(course, numbers) for course in errors.courses))


def most_likely(problem, rounds=4):
    """The estimate by generalised least squares, with the error model of its errors,
    again and again."""
    theta = least_squares(problem.columns, problem.measured)
    likelihood = make_likelihood(problem)
    for _ in range(rounds):
        likelihood = likelihood_at(problem, theta)
        weighing = likelihood.errors
        theta = least_squares(
            weighing.innovations(problem.columns),
            weighing.innovations(problem.measured[None])[0],
        )
    return theta, likelihood.shown.numbers
