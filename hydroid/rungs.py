"""The rungs: the models that an arm can have, from the poorest to the richest.

A rung says here what of the machine its model has, and how finely it steps. How its arm
rolls, and how fast joints settle, is its law: `simulation.laws` has that of each rung.
A fit may climb from one rung of its stage to the next (`fitting.ladder`).
"""

from dataclasses import dataclass
from typing import Literal

from hydroid.quantity_table import MECHANICAL, QUANTITIES, TARGETS

Stage = Literal["mech", "hyd"]
Climb = Literal["dynamic", "quasi-static", "ladder"]
"""names of what a fit of stage 2 climbs, as settings say it: keys of CLIMBS"""


@dataclass(frozen=True)
class Rung:
    """A model of the arm.

    Attributes:
        name: in `simulation.model` and in the names of estimates.
        stage: of the fits that it belongs to.
        at_once: whether speeds follow valve and load at once, without inertia. One step
            a sample is then enough, and joints that follow a log take its angles.
            Valves open as `simulation.openings` says, whatever the arm does.
        lacks: quantities that have no effect, each side by itself.
    """

    name: str
    stage: Stage
    at_once: bool
    lacks: frozenset[str]

    def has(self, quantity: str) -> bool:
        """Return whether a quantity, or one of its two sides, has an effect."""
        return not self.lacks.issuperset(TARGETS[quantity])

    def stepping(self, steps_per_sample: int, substeps: int) -> "Stepping":
        """Return how the model steps where settings ask for so many steps of MuJoCo per
        sample, and so many sub-steps of valves and oil in each."""
        if self.at_once:
            return Stepping(self, 1, substeps * steps_per_sample)
        return Stepping(self, steps_per_sample, substeps)


@dataclass(frozen=True)
class Stepping:
    """A rung, and how finely it steps.

    Attributes:
        steps: of the arm, in a sample of the log.
        substeps: of valves and oil, in a step of the arm.
    """

    rung: Rung
    steps: int
    substeps: int


def _targets(*quantities: str) -> frozenset[str]:
    """Return quantities, each side by itself."""
    return frozenset(side for name in quantities for side in TARGETS[name])


BY_COMMAND = "by_command"
"""quantity of a joint whose speed follows its command alone, where it is 1"""
WITHOUT_EFFECT = _targets(
    *("area", "lever_slope", "lever_bend", "damping", "friction", "dry_friction"),
    *("stiffness", "compensation", "return", "flow_limit"),
)
"""quantities that such a joint does not have: those of its load, and its area and the
lever of a stand-in, of which its opening alone tells the speed"""

GAIN = Rung(
    name="gain",
    stage="mech",
    at_once=False,
    lacks=frozenset(QUANTITIES) - {*MECHANICAL},
)
"""a gain turns commands into torques: stage 1, the article's section 3"""

QUASI_STATIC = Rung(
    name="quasi-static",
    stage="hyd",
    at_once=True,
    lacks=_targets(
        "gain",
        "leakage",
        "anticavitation",
        "transition_pressure",
        "bulk_modulus",
        "dead_volume",
        "line_volume",
        "stop_penetration",
        "start_pressure",
        "trapped_pressure",
    ),
)
"""speed follows valve and load at once (`simulation.quasi_static`)"""

DYNAMIC = Rung(
    name="dynamic",
    stage="hyd",
    at_once=False,
    # what stands in the rung below for its oil and its inertia
    lacks=_targets(
        *("gain", "oil_frequency", "oil_damping", "oil_damping_share", "by_command")
    ),
)
"""valves, oil and arm are stepped together (`simulation.rollout`)"""

RUNGS = {rung.name: rung for rung in (GAIN, QUASI_STATIC, DYNAMIC)}

CLIMBS: dict[str, tuple[Rung, ...]] = {
    "dynamic": (DYNAMIC,),
    "quasi-static": (QUASI_STATIC,),
    "ladder": (QUASI_STATIC, DYNAMIC),
}
"""the rungs that a fit of stage 2 climbs, the first one first

Runs store the name, and what they call `refined` is on the first rung. So what a name
stands for stays as it is: a rung that is to come first has a climb of its own.
"""


def rungs_of(stage: Stage, climb: str) -> tuple[Rung, ...]:
    """Return the rungs that a fit climbs, the first one first."""
    if stage == "mech":
        return (GAIN,)
    return CLIMBS[climb]


def stage_has(stage: Stage, quantity: str) -> bool:
    """Return whether a quantity has an effect on some rung of a stage."""
    of_stage = [rung for rung in RUNGS.values() if rung.stage == stage]
    return any(rung.has(quantity) for rung in of_stage)
