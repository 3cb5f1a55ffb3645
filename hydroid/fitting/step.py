"""What a fit does next: one least squares, as a record that names its checkpoint and
its line of progress."""

from dataclasses import dataclass, replace
from enum import IntEnum
from typing import Literal

Phase = Literal["", "from afar", "at first", "on the way"]
"""of a rung: by output errors, to see whether it is likely at all, to see whether it is
better, or to the end (no words)"""


class Start(IntEnum):
    """Numbers of starts in the names of checkpoints, which stored runs have: a rung is
    refined from the estimate below it, which has none, and from these."""

    AGAIN = 2
    """the estimate itself, where joints alone have led on"""
    ANEW = 3
    """where independent output errors lead from it"""
    JOINTS_ANEW = 4
    """with joints that began alone elsewhere"""
    PUMP_ANEW = 5
    """with a pump on open centres"""
    AS_IT_IS = 6
    """a joint alone as it is, beside one by its command alone"""
    JOINTS_FIRST = 7
    """with terms that joints alone have asked for"""
    ROUND = 8
    """what is added to those of one round of trials of joints alone in the next one"""


@dataclass(frozen=True)
class Step:
    """One least squares of a fit.

    Attributes:
        model: start (a start of the search), refined, dynamic or joint; or what a
            comparison calls it.
        terms: that the model has.
        phase: of the rung.
        start: number of the start, from 1; 0: none.
        joint: that is fitted alone, from 1; 0: all joints.
        numbers: whether it begins at the nine numbers of the joint.
        horizon: number of the part of the logs that it is fitted to, from 1; 0: all of
            them.
    """

    model: str
    terms: tuple[str, ...] = ()
    phase: Phase = ""
    start: int = 0
    joint: int = 0
    numbers: bool = False
    horizon: int = 0

    @property
    def estimate(self) -> str:
        """Name of the estimate that it leads to: model and terms."""
        return "+".join([self.model, *self.terms])

    @property
    def name(self) -> str:
        """Its own name: no two least squares of a fit have the same."""
        # checkpoints of stored runs are found by these words, in this order
        words = [self.estimate]
        if self.start:
            words.append(str(self.start))
        if self.joint:
            words.append(f"joint {self.joint}")
        if self.numbers:
            words.append("numbers")
        if self.horizon:
            words.append(f"part {self.horizon}")
        if self.phase:
            words.append(self.phase)
        return " ".join(words)

    @property
    def on_its_way(self) -> bool:
        """Whether another least squares goes on from where it ends, and only that end
        counts."""
        return self.model == "start" or self.phase in ("from afar", "at first")

    @property
    def is_last(self) -> bool:
        """Whether nothing refines its end any further: an estimate of all joints."""
        return not (self.phase or self.joint or self.model == "start")

    def changed(self, **changes: object) -> "Step":
        """Return the step with other attributes."""
        return replace(self, **changes)  # pyright: ignore[reportArgumentType]


def step_of(estimate: str) -> Step:
    """Return the step that leads to an estimate by its name."""
    model, *terms = estimate.split("+")
    return Step(model, tuple(terms))
