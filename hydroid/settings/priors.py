"""What is known besides the logs: a mass from a crane scale, a ratio from a catalogue, a plausible value."""

from typing import Annotated

from pydantic import Field, model_validator

from hydroid.settings.load import Settings

Positive = Annotated[float, Field(gt=0)]


class PriorSettings(Settings):
    """One statement about parameters, exact or with the standard deviation of what it says.

    known:
      total mass: {of: [M1, M2, M3, M4, M5, M6], value: 42.5, sd: 0.5}   # their sum
      forearm:    {of: M5, value: 4.0, sd: 0.4}                          # a Gaussian prior
      balance:    {of: {M3: 1, M4: -2}, value: 0, sd: 0.5}               # M3 - 2 M4
      areas:      {ratio: [A_A, A_B], value: 1.333}                      # A_A / A_B
    """

    of: str | list[str] | dict[str, float] | None = None
    """a parameter, parameters that are added up, or parameters with their factors"""
    ratio: tuple[str, str] | None = None
    """the first parameter over the second"""
    value: float
    """in the unit of the parameters"""
    sd: Positive | None = None
    """standard deviation of the value; left out: exact"""

    @model_validator(mode="after")
    def _one(self) -> "PriorSettings":
        if (self.of is None) == (self.ratio is None):
            raise ValueError(
                "give either of: parameter, [parameters] or {parameter: factor}, or ratio: [a, b]"
            )
        if isinstance(self.of, list) and len(set(self.of)) < len(self.of):
            raise ValueError("of: a parameter stands there twice")
        if not self.factors or not any(self.factors.values()):
            raise ValueError("names no parameter")
        if self.ratio is not None and self.ratio[0] == self.ratio[1]:
            raise ValueError("ratio: needs two different parameters")
        return self

    @property
    def factors(self) -> dict[str, float]:
        """Parameters with their factors; of a ratio those of a - value b, which is 0 where it holds."""
        if self.ratio is not None:
            return {self.ratio[0]: 1.0, self.ratio[1]: -self.value}
        if isinstance(self.of, str):
            return {self.of: 1.0}
        return self.of if isinstance(self.of, dict) else dict.fromkeys(self.of or (), 1.0)
