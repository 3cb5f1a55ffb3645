"""Findings: what an analysis has to say, and the words of each kind. Terminal, JSON and report read them."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from hydroid.words import filled

Level = Literal["error", "warning", "note"]
"""error: the input or result cannot be used; warning: do not use it unread; note: good to know"""


@dataclass(frozen=True)
class Finding:
    """One thing that an analysis found; as text it is what it states, and the hint.

    Attributes:
        kind: key of its words in `WORDS`. Decisions are made on it, never on a sentence.
        level: how much it matters.
        subjects: names of what it is about: parameters, joints, logs.
        numbers: what the sentence states, by name, in the units that the sentence prints.
        where: file with line and column, or a setting; empty where there is none.
    """

    kind: str
    level: Level
    subjects: tuple[str, ...] = ()
    numbers: Mapping[str, float | str] = field(default_factory=dict[str, float | str])
    where: str = ""

    @property
    def what(self) -> str:
        """What it states."""
        return filled(WORDS[self.kind][0], self.subjects, self.numbers)

    @property
    def hint(self) -> str:
        """What to do about it; empty where nothing is to be done."""
        return filled(WORDS[self.kind][1], self.subjects, self.numbers)

    def __str__(self) -> str:
        return f"{self.what} {self.hint}".strip()


_OUTSIDE = (
    "{quantity} of joint{s} {names} is {value:.6g} {unit}, allowed are {low:.6g} to {high:.6g} {unit}{rows}"
)
_RANGE = "if commands are in {range}, set log.command.scale: {scale}"
_BRINGS = "{what} would be known to {after} % instead of {before} %."

WORDS: dict[str, tuple[str, str]] = {
    # a fit
    "not refined": (
        "The estimate comes from the search alone and need not be an optimum.",
        "Fit again without --no-refinement.",
    ),
    "not converged": (
        "The refinement '{0}' did not converge: {ending}. Do not trust the estimate or its intervals.",
        "Allow more iterations (refinement.iterations), or try another seed.",
    ),
    "diverged": ("The simulation of the estimate '{0}' diverged. It is not used.", ""),
    "at zero": ("{names} {is} 0, the least possible value: the logs show no such effect.", ""),
    "at bound": (
        "{names} {is} at the {side} bound. The error would fall further beyond it.",
        "Widen the bound if such values are possible. Otherwise the model lacks something.",
    ),
    "strained prior": (
        "The estimate of {0} is {score:.1f} standard deviations {side} its prior.",
        "Either the prior is wrong, or the parameter makes up for an error of the model.",
    ),
    "logs disagree": (
        "The model errs differently in each log, so the 95 % intervals of {few} are too narrow.",
        "Use the intervals by log. Of less than six logs these are rough too: add logs.",
    ),
    "no effect": (
        "{few} {has} no effect on the compared angles.",
        "Hold {them} fixed, or compare another joint.",
    ),
    "not identifiable": (
        "The logs do not determine {few}.",
        "State priors, compare more joints, or add logs in other poses.",
    ),
    "prior only": ("The logs add next to nothing to the prior{s} of {few}.", ""),
    "weakly identifiable": ("{few} {is} known to 30 to 100 % only.", ""),
    "effect unknown": ("The simulation diverges when {few} {is} changed: {its} effect is unknown.", ""),
    "combination": ("{few} cannot be told apart: changed together, they give nearly the same motion.", ""),
    "quantities open": ("The logs do not determine these quantities: {few}.", ""),
    "behind nine numbers": (
        "On its own logs the fit errs more than nine numbers do in {few}: it is at a wrong optimum, or its "
        "model is wrong.",
        "Try another seed.",
    ),
    # advice: the statement says what to do, the hint what it would bring
    "fails unseen": (
        "The fit fails on unseen logs in {few}.",
        "Fit them too, and keep another to validate on. Where only the load differs, use `hydroid adapt`.",
    ),
    "nothing missing": (
        "Tested: {count} quantities that the fit holds. Freeing none of them would lower the error on data "
        "left out.",
        "",
    ),
    "look for terms": (
        "Find what the model lacks, and what to measure next.",
        "`suggest` tries the most promising terms.",
    ),
    "term missing": (
        "Free {0}: the error of {1} on parts of the logs left out falls by {part:.0f} %.",
        "Keep it if the error on an unseen log falls too.",
    ),
    "more terms missing": (
        "{few} would also lower the error, but may describe the same error.",
        "Free one at a time, and validate each new fit.",
    ),
    "weigh": ("Weigh {0} to ±{sd:.0f} %.", _BRINGS),
    "state": ("State {0} to ±{sd:.0f} %, from a data sheet or a measurement.", _BRINGS),
    "experiment": ("Run the designed experiment of {0} s (`hydroid design`).", _BRINGS),
    "fit the hydraulics": ("Fit the hydraulics.", "Stage 1 has a gain in their place: most of its error."),
    "predict unseen": (
        "Test the fit on a log that it has not seen.",
        "'Not tested' says that none was given that drives the joint.",
    ),
    "use the machine": ("Simulate the machine.", "`load_plant` gives it to a controller in Python."),
    "run the experiment": (
        "Run commands.csv on the machine.",
        "The limits were checked only in simulation, at the present estimate; the machine moves differently "
        "as far as it differs from the model. Watch the first run with a hand on the emergency stop.",
    ),
    # an assumption
    "sign doubted": (
        "The logs contradict the sign of {0}'s angle: turned round, the arm's weight explains its speeds "
        "better.",
        "Does gravity pull it the other way? Then set scale: -1 for its angle and its command, or turn the "
        "axis in the arm's model, and fit again. Change one joint at a time.",
    ),
    "columns exchanged": (
        "{0} moves with the command of {1}, and {1} with that of {0}.",
        "Exchange their columns in log.joints.",
    ),
    # a profile
    "better optimum": (
        "The profile{s} of {few} found a better fit than the estimate, which is no optimum.",
        "Fit again from there, with more iterations or another seed.",
    ),
    # a log: statements follow the file, line and column, and end with no full stop; `{rows}` is empty, or
    # counts the rows below the first one
    "unreadable": ("{what}", "{hint}"),
    "layout": ("{what}", ""),
    # its columns
    "absent joints": ("has no column of joint{s} {names}", ""),
    # its rows and cells
    "torn row": (
        "the row should have {cells} cells, as the header has, and numbers in them{rows}",
        "correct or delete the line, or use --repair; numbers with decimal commas need ; between the cells",
    ),
    "hole": (
        "{what}{rows}",
        "correct the cell; --repair fills up to {longest:g} s (log.repair_s) between good cells",
    ),
    "no time": (
        "{what}{rows}",
        "time is a number in log.time.unit, or a time of day (12:30:05.25), with or without date",
    ),
    "outside": (
        _OUTSIDE,
        "correct the cells, or unit, scale and offset of {name} in log.{quantity}, or the joint's range",
    ),
    "outside in another range": (_OUTSIDE, _RANGE),
    "outside in another unit": (_OUTSIDE, "if angles are in {other}, set log.angle.unit: {other}"),
    "outside, turned": (
        _OUTSIDE,
        "if joint {0} counts the other way, set log.joints.{0}.angle.scale: {scale}",
    ),
    "jump": (
        "{0} jumps by {step:.6g} deg from one sample to the next{rows}",
        "correct the cells, or log.angle's unit and scale",
    ),
    "wrap": ("{0} wraps by 360 deg and was joined{rows}", ""),
    "repair": (
        "repaired: cells filled: {cells:.0f}, samples inserted: {samples:.0f}, rows left out: {lost:.0f}",
        "angles interpolated, commands held",
    ),
    # its time
    "time order": (
        "time does not increase: {time:.12g} s follows {before:.12g} s{rows}",
        "delete or sort the lines, or log the time with more digits",
    ),
    "too short": ("lasts {duration:.6g} s (samples: {samples:.0f}); at least 0.5 s is needed", "{remedy}"),
    "too slow": ("has a sample every {period:.6g} s, at most {slowest:g} s can be used", "{remedy}"),
    "gap": (
        "{gap:.6g} s without a sample, the usual step is {period:.6g} s{rows}",
        "--repair fills gaps up to {longest:g} s (log.repair_s); cut the log into two files at longer ones",
    ),
    "resampled": (
        "has a sample every {step} s and is resampled to {period:g} s (log.period_s)",
        "angles interpolated, commands held, or averaged where the log is faster",
    ),
    # its units
    "unit": (
        "the file says that {names} {is} in {unit}, but log.{quantity} says otherwise",
        "set log.{quantity}.{remedy}",
    ),
    "range": ("the command of joint{s} {names} looks like {range}", "if so, set log.command.scale: {scale}"),
    # its motion
    "undriven": ("no joint is driven: all commands are 0", "check log.command"),
    "late": (
        "angle of joint{s} {names} moves {lag:.2f} s before the command, as no machine does",
        "the log's clocks differ: mend the log, or set log.delay_s: {delay:.2f}",
    ),
    "angle is constant": ("angle of joint{s} {names} never changes", "check the sensor and log.angle"),
    "command is constant": (
        "command of joint{s} {names}, whose angle is compared, is constant",
        "such a log alone says little: fit it together with others",
    ),
    "turned": (
        "joint {0} moves against its command (in {against:.0%} of the {path} that it moves)",
        "if the command is logged with the opposite sign, set log.joints.{0}.command.scale: -1",
    ),
    "no motion": (
        "strong commands hardly move joint{s} {names}: by {most} at most",
        "check log.joints (is this the angle of that command?), and if angles are in rad, "
        "set log.angle.unit: rad",
    ),
    "at a stop": (
        "joint {0} is driven against the end of its travel for {seconds:.3g} s",
        "this time says nothing about the valve; the joint's range in the arm's file should end there",
    ),
    "no rest": (
        "begins with a command{after}",
        "its first sample alone gives the start pose: begin a log with a second of rest",
    ),
}
"""statement and hint by kind; a hint may be empty"""
