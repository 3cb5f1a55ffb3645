"""A quantity of one's own: `quantity`."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from hydroid.commands.inputs import ModelSource, open_model
from hydroid.errors import RunError

if TYPE_CHECKING:
    from hydroid.parameters import Array
    from hydroid.plant import Plant


@dataclass(frozen=True, eq=False)
class QuantityResult:
    """A quantity with what a fit knows of it.

    Attributes:
        value: at the estimate, of the shape S that the function returns.
        sd: standard deviation, shape S; infinite where the logs do not determine it.
        interval: of 95 %, shape (S, 2).
        unit: as given.
    """

    value: "Array"
    sd: "Array"
    interval: "Array"
    unit: str = ""


def quantity(
    model: ModelSource, function: "Callable[[Plant], ArrayLike]", *, unit: str = "", positive: bool = False
) -> QuantityResult:
    """Compute a quantity of one's own from a fit, with its 95 % interval.

        def speed(plant):
            before = plant.reset("study")[1]
            for _ in range(50):
                after = plant.step({"shoulder": 50})[1]
            return (after - before) / 0.5
        found = hydroid.quantity("runs/a", speed, unit="rad/s")
        print(found.value, found.interval, found.unit)

    Args:
        model: the run folder of a fit, or a plant saved from one.
        function: takes a `Plant` and returns a number or an array. It is called with 2 p + 1 plants, p free
            parameters, and should be smooth in them: interpolate an event between two samples.
        unit: of the value, for the reader.
        positive: the quantity cannot be negative; its interval is then multiplicative.

    Raises:
        RunError: the folder has no covariance of these parameters, or a simulation diverged.
    """
    from hydroid.plant import Plant
    from hydroid.posterior.posterior import stored_posterior

    opened = open_model(model)
    known = stored_posterior(opened)
    if known is None:
        hint = "name the folder of a fit, with the settings that it used"
        raise RunError("holds no covariance of these parameters", where=opened.source, hint=hint)
    shape = np.shape(function(Plant(opened)))

    def values(theta: "Array") -> "Array":
        plants = (Plant(replace(opened, theta=row)) for row in theta)
        return np.stack([np.ravel(np.asarray(function(plant), float)) for plant in plants])

    found = known.propagate(values, positive)
    ends = found.interval.reshape(*shape, 2)
    return QuantityResult(found.value.reshape(shape), found.sd.reshape(shape), ends, unit)
