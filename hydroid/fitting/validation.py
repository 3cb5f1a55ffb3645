"""How well a model predicts a log: its response with a band, and the article's error
indices (table 9).
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import field, replace
from functools import partial
from math import degrees
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from hydroid.arrays import Array, record, rms
from hydroid.estimate import finite
from hydroid.files import Plain
from hydroid.fitting.fit import Fit
from hydroid.identified_model import IdentifiedModel
from hydroid.log import Log
from hydroid.posterior.band import Band, fitted_bands, prediction_bands
from hydroid.prediction import OilTrace, predict, predict_with_oil
from hydroid.progress import LOGGER
from hydroid.units import display
from hydroid.words import listed, three_digits

if TYPE_CHECKING:
    import pandas

HORIZONS = (0.5, 1.0, 2.0, 5.0, 10.0)
"""over which a predicted change of an angle is compared [s]"""
SETTLING = 2.0
"""simulated before each start of a horizon, and from start to start [s]"""


@record
class ErrorIndices:
    """Indices of an output error: mean absolute, rms and largest [rad], and fit [%].

    fit = 100 (1 - |y - y_hat| / |y - mean(y)|), 100 for a perfect response, 0 for the mean of the
    data; NaN where the data do not move.
    """

    mean_absolute: float
    rms: float
    largest: float
    fit: float


@record
class JointPrediction:
    """What a model makes of one joint in a log, in deg, or in mm of a joint that
    slides.

    Attributes:
        name: of the joint.
        unit: `deg` or `mm`.
        time: [s], shape (T,).
        measured: angle or position, shape (T,).
        response: that of the model, shape (T,).
        half: half of the 95 % prediction band, shape (T,); None: the model is no fit.
    """

    name: str
    unit: str
    time: Array
    measured: Array
    response: Array
    half: Array | None

    @property
    def error(self) -> Array:
        """Measured minus response, shape (T,)."""
        return self.measured - self.response

    @property
    def rms(self) -> float:
        """The rms of the error; NaN if the simulation diverged."""
        return float(rms(self.error))

    def __repr__(self) -> str:
        size = np.abs(self.error)
        said = f"{self.name}: the simulation diverged"
        if np.isfinite(size).all():
            place = int(np.argmax(size))
            said = (
                f"{self.name}: rms error {three_digits(self.rms)} {self.unit}, largest "
                f"{three_digits(float(size[place]))} {self.unit} at {self.time[place]:.1f} s"
            )
        arrays = "time, measured, response, error"
        if self.half is not None:
            arrays += ", half (of the 95 % band)"
        return f"{said}\narrays of {len(self.time)} samples: {arrays}"


@record
class Prediction:
    """What a model makes of a log's commands.

        prediction = fitted.predict("b.csv")
        print(prediction["boom"].error)  # [deg]
        prediction.to_frame()["boom"].plot()

    Attributes:
        fit: name of the model.
        log: what it is compared with.
        joints: K that are compared, numbered from 1.
        response: their angles [rad], shape (T, K).
        bands: prediction bands by joint; empty of a model that is no fit.
        unseen: whether the model was made without this log; None: not known.
        apart: whether a user has said that it is of other conditions than the fit's: no
            verdict counts it.
        names: of the joints; empty: their numbers stand for them.
        slides: numbers of those joints that slide.
        ahead: `errors_ahead` of the joints [rad], shape (N, HORIZONS, K); none where N
            is 0.
        oil: pressures and flows of the joints; None: the model has no hydraulics.
    """

    fit: str
    log: Log
    joints: tuple[int, ...]
    response: Array
    bands: Mapping[int, Band]
    unseen: bool | None
    ahead: Array = field(default_factory=partial(np.empty, (0, len(HORIZONS), 0)))
    apart: bool = False
    names: tuple[str, ...] = ()
    slides: tuple[int, ...] = ()
    oil: OilTrace | None = None

    def __getitem__(self, joint: str | int) -> JointPrediction:
        """Return what is predicted of a joint, by its name or its number from 1.

        Raises KeyError: the model compares no such joint.
        """
        named = dict(zip(self._named, self.joints, strict=True))
        number = joint
        if isinstance(joint, str):
            number = named.get(joint, joint)
        if number not in self.joints:
            raise KeyError(
                f"no joint {joint!r} is predicted; there {_are(self._named)}"
            )
        shown = display(slides=number in self.slides)
        column = self.joints.index(number)
        # models without a covariance have no bands
        half = None
        if number in self.bands:
            half = shown.factor * self.bands[number].half
        return JointPrediction(
            name=self._named[column],
            unit=shown.unit,
            time=self.log.time,
            measured=shown.factor * self.log.angle_of(number),
            response=shown.factor * self.response[:, column],
            half=half,
        )

    def __iter__(self) -> Iterator[str]:
        return iter(self._named)

    @property
    def _named(self) -> tuple[str, ...]:
        return self.names or tuple(map(str, self.joints))

    def to_frame(self) -> "pandas.DataFrame":
        """Return one row per sample, by its time [s].

        Columns are, for each joint, `measured`, `response`, `error`, and where there is
        a band `half` of it, in deg, or in mm of a joint that slides.
        """
        import pandas

        columns = dict[tuple[str, str], Array]()
        for name in self:
            one = self[name]
            columns[name, "measured"] = one.measured
            columns[name, "response"] = one.response
            columns[name, "error"] = one.error
            if one.half is not None:
                columns[name, "half"] = one.half
        index = pandas.Index(self.log.time, name="time [s]")
        return pandas.DataFrame(columns, index=index)

    def __repr__(self) -> str:
        seen = {True: ", unseen", False: ", fitted", None: ""}[self.unseen]
        errors = [
            f"{one.name} {three_digits(one.rms)} {one.unit}"
            for one in map(self.__getitem__, self)
        ]
        name = next(iter(self), "JOINT")
        return (
            f"{self.fit} on {Path(self.log.source).name}: {self.log.duration:.0f} s{seen}\n"
            f"rms error: {listed(errors)}\n"
            f'more: prediction["{name}"].error, prediction.to_frame()'
        )

    @property
    def indices(self) -> dict[int, ErrorIndices]:
        """By joint."""
        return {
            j: error_indices(self.log.angle_of(j), self.error(j)) for j in self.joints
        }

    def error(self, joint: int) -> Array:
        """Return measured minus simulated angle of a joint [rad], shape (T,)."""
        return self.log.angle_of(joint) - self.response[:, self.joints.index(joint)]

    def plain(self, names: Sequence[str]) -> list[Plain]:
        """Return one mapping per joint, as JSON has them (docs/json.md).

        `names` are of all joints.
        """
        rows: list[Plain] = []
        for joint, one in self.indices.items():
            row = Plain(
                {
                    "fit": self.fit,
                    "log": self.log.source,
                    "joint": joint,
                    "name": names[joint - 1],
                }
            )
            errors = {"mae": one.mean_absolute, "rms": one.rms, "max": one.largest}
            if band := self.bands.get(joint):
                row["inside_percent"] = 100 * band.inside
                errors |= {"noise": band.noise, "expected": band.expected}
            row |= {
                f"{name}_deg": finite(degrees(error)) for name, error in errors.items()
            }
            rows.append(row | {"fit_percent": finite(one.fit)})
        return rows


def _are(names: Sequence[str]) -> str:
    if len(names) == 1:
        return f"is {names[0]}"
    return f"are {listed(names)}"


def error_indices(measured: Array, error: Array) -> ErrorIndices:
    """Return the indices of an error of the measured angle [rad], both of shape
    (T,)."""
    size, spread, part = rms(error), np.std(measured), np.abs(error)
    # else it moves by rounding only
    fit = np.nan
    if spread > 1e-9:
        fit = 100 * (1 - size / spread)
    return ErrorIndices(part.mean(), size, part.max(), fit)


def predicted(model: IdentifiedModel, log: Log, unseen: bool | None) -> Prediction:
    """Return a model's prediction of a log: NaN, with a warning, where the simulation
    diverges."""
    joints = tuple(model.settings.outputs)
    response, oil = predict_with_oil(model, log, joints)
    bands = dict[int, Band]()
    if np.isfinite(response).all():
        bands = prediction_bands(model, log, response)
    else:
        LOGGER.warning(
            "warning: %s predicts no joint in %s: its simulation diverged",
            model.name,
            log.source,
        )

    def errors(part: Log) -> Array:
        return part.angle[:, [j - 1 for j in joints]] - predict(model, part, joints)

    arm = model.settings.arm
    named = tuple(arm.name_of(joint) for joint in joints)
    found = Prediction(
        model.name,
        log,
        joints,
        response,
        bands,
        unseen,
        names=named,
        slides=tuple(arm.slides),
        oil=oil,
    )
    if unseen is False:
        return found
    return replace(found, ahead=errors_ahead(log, errors))


def errors_ahead(log: Log, errors: Callable[[Log], Array]) -> Array:
    """Return by how much predicted changes of angles over HORIZONS are off, from starts
    all along a log.

    Each start is simulated from SETTLING before it, at the angles measured there:
    valves, pilot stages and pump are then as the commands have left them. `errors` are
    those of a part of the log [rad], shape (T,) or (T, K). Each start has a row [rad],
    shape (N, HORIZONS) or (N, HORIZONS, K); NaN where the log ends before.
    """
    before, rows = round(SETTLING / log.period), list[Array]()
    steps = np.array([before + round(seconds / log.period) for seconds in HORIZONS])
    for first in range(0, len(log.time) - int(steps[0]), before):
        error = errors(log.part(first, first + int(steps[-1]) + 1))
        row = np.full((len(steps), *error.shape[1:]), np.nan)
        there = steps < len(error)
        # NaN: it diverged
        row[there] = np.nan_to_num(error[steps[there]] - error[before], nan=np.inf)
        rows.append(row)
    return np.array(rows)


def fitted(fit: Fit) -> tuple[Prediction, ...]:
    """Return what the final estimate of a fit makes of its own logs."""
    settings = fit.problem.settings
    joints = tuple(settings.outputs)
    model = IdentifiedModel(settings, fit.best.theta, fit.final)
    responses = fit.best.responses
    bands = fitted_bands(fit.problem, fit.uncertainty, responses)
    predictions = list[Prediction]()
    for log, angles, of_log in zip(fit.problem.logs, responses, bands, strict=True):
        one = Prediction(
            fit.final,
            log,
            joints,
            angles,
            of_log,
            False,
            names=tuple(settings.arm.name_of(joint) for joint in joints),
            slides=tuple(settings.arm.slides),
            oil=predict_with_oil(model, log, joints)[1],
        )
        predictions.append(one)
    return tuple(predictions)
