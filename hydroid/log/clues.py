"""What the name and the unit of a column say about it."""

import re
from collections.abc import Collection, Sequence
from itertools import pairwise

import numpy as np

from hydroid.arrays import Ints
from hydroid.files import read_table
from hydroid.units import UNITS, Unit, bare, unit_of

CLUES = read_table("log/clues.yaml")
RAW = ("voltage", "current")
"""quantities in which sensors and amplifiers speak"""
COMMAND_WORDS = {"cmd", "command", "commands", "joystick", "joy"}
"""words that say command, whatever others a name holds"""
GENERIC_WORDS = {"joint", "link"}
"""words of a joint's name that tell it from no other"""
SHORTEST_CUT = 3
"""letters that are left of a word which is cut short"""
LONGEST_NUMBER = 2
"""digits of a joint in a column's name"""


def words(name: str) -> list[str]:
    """Return the words of a column's name in lower case: "valveCmd_2 [V]" gives valve,
    cmd, 2, v."""
    # "mA" is one word, though it looks like two
    found = re.findall(r"m[AV](?![A-Za-z])|[A-Z]?[a-zäöüß]+|[A-Z]+(?![a-z])|\d+", name)
    return [word.lower() for word in found]


def column_unit(name: str, given: str) -> Unit | None:
    """Return the unit that the file gives, or the one in or at the end of the name;
    None: there is none."""
    inside = re.search(r"[\[(<]([^\])>]*)[\])>]\s*$", name)
    in_brackets = ""
    if inside:
        in_brackets = inside[1]
    last_word = re.split(r"[_ .]", name)[-1]
    # elsewhere "in" is a direction
    may_be_inch = [given, in_brackets]
    if not {*words(name)}.isdisjoint(CLUES["lengths"]):
        may_be_inch.append(last_word)
    if any(bare(text).lower() in ("in", '"') for text in may_be_inch):
        return UNITS["inch"]
    for text in (given, in_brackets, last_word):
        unit = unit_of(text)
        if unit and unit.quantity != "ambiguous":
            return unit
    return None


def kind_of(name: str, unit: Unit | None) -> str:
    """Return time, command, angle, target or other: what the unit, or else the words of
    a name say of a column."""
    in_name = {*words(name)}
    if not in_name.isdisjoint(CLUES["derived"]):
        return "other"
    # also in /joint_commands.position[boom]
    if not unit and in_name & COMMAND_WORDS:
        return "command"
    kind = _kind_by_unit(in_name, unit) if unit else _kind_by_words(name)
    # a part of the whole opening is as good as a command
    if is_of_a_valve(name) and (kind != "command" or not unit):
        return "other"
    if kind == "angle" and not in_name.isdisjoint(CLUES["targets"]):
        return "target"
    return kind


def _kind_by_unit(in_name: Collection[str], unit: Unit) -> str:
    """Return the kind of a column with a unit; its words say more of what a sensor
    gives."""
    if unit.quantity in RAW and not {*in_name}.isdisjoint(CLUES["sensors"]):
        return "angle"
    return CLUES["units"].get(unit.quantity, "other")


def is_of_a_valve(name: str) -> bool:
    """Return whether a name says that a position is that of a valve's spool."""
    parts = CLUES["valve_parts"]
    return any(
        first in parts["of"] and second in parts["is"]
        for first, second in pairwise(words(name))
    )


def command_rank(name: str) -> int:
    """Return which of a joint's commands comes first: 0 of one that reaches the valve, 2
    of one that a person gives, 3 of one that is rather an angle to be reached."""
    in_name = {*words(name)}
    if not in_name.isdisjoint(CLUES["turns"]):
        return 3
    at_the_valve = not in_name.isdisjoint(CLUES["at_the_valve"])
    by_hand = not in_name.isdisjoint(CLUES["by_hand"])
    return 1 - at_the_valve + by_hand


def _kind_by_words(name: str) -> str:
    """Return the kind that a name says, by the last of its words that says one."""
    for word in reversed(words(name)):
        for kind, vocabulary in CLUES["kinds"].items():
            if word in vocabulary:
                return kind
    # "boom_up" is what a valve is told
    sign, _ = direction(name)
    return "command" if sign else "other"


def is_counter(name: str, unit: Unit | None) -> bool:
    """Return whether a column counts samples or cycles, by its name: its unit, and its
    words, say nothing of a time."""
    in_name = {*words(name)}
    if unit or not in_name.isdisjoint(CLUES["kinds"]["time"]):
        return False
    return not in_name.isdisjoint(CLUES["counters"])


def distinctive_part(name: str) -> str:
    """Return what a column has for itself: of `/CalibratedJointVals3.position[Boom]`
    Boom, else its name.

    What stands before the brackets names the topic of a bag, whose columns share it.
    """
    inside = re.fullmatch(r"/.*\[([^\[\]]*)\]", name)
    if inside and unit_of(inside[1]) is None:
        return inside[1]
    return name


def joint_of(name: str, joints: Sequence[str]) -> int | None:
    """Return the number [from 1] of the only joint whose name a column's name holds;
    None: of none.

    Words of three letters and more may be cut short: `tele1_cmd` is the telescope's.
    Of several joints it is the one that shares most words: `left_boom_deg` is no angle
    of `left_stick`, nor of `right_boom`.
    """
    part = distinctive_part(name)
    if part != name:
        joint = joint_of(part, joints)
        if joint:
            return joint
    exact = [{*words(joint)} - GENERIC_WORDS for joint in joints]
    alike = [_with_synonyms(joint_words) for joint_words in exact]
    cut = [_cut_short(joint_words) for joint_words in alike]
    in_name = {*words(name)} - GENERIC_WORDS
    against = [_contradicts(in_name, joint_words) for joint_words in exact]
    # the first way in which the name is one joint's decides
    for words_of_joints in (exact, alike, cut):
        shared = np.array([len(in_name & own) for own in words_of_joints], int)
        joint = _only_largest(np.where(against, 0, shared))
        if joint is not None:
            return joint
    return None


def _contradicts(in_name: Collection[str], joint_words: Collection[str]) -> bool:
    """Return whether a name tells another side than a joint's name."""
    for pair in CLUES["opposite"]:
        told = {*pair}.intersection(in_name)
        own = {*pair}.intersection(joint_words)
        if told and own and told.isdisjoint(own):
            return True
    return False


def _with_synonyms(joint_words: set[str]) -> set[str]:
    """Return words, and other words for the same joint."""
    alike = {*joint_words}
    for synonyms in CLUES["same"]:
        if not joint_words.isdisjoint(synonyms):
            alike.update(synonyms)
    return alike


def _cut_short(joint_words: Collection[str]) -> set[str]:
    cut = set[str]()
    for word in joint_words:
        cut.update(word[:letters] for letters in range(SHORTEST_CUT, len(word)))
    return cut


def _only_largest(shared: Ints) -> int | None:
    """Return the number of the only joint with the most words shared, (J,); None: none
    or several have."""
    most = shared.max(initial=0)
    if most and np.count_nonzero(shared == most) == 1:
        return int(shared.argmax()) + 1
    return None


def number_in(name: str) -> int | None:
    """Return the last number in a column's name; None: it has none."""
    numbers = [word for word in words(distinctive_part(name)) if word.isdecimal()]
    if not numbers:
        return None
    last = numbers[-1].lstrip("0") or "0"
    # a longer one is no joint's, and Python refuses to convert texts of thousands
    if len(last) <= LONGEST_NUMBER:
        return int(last)
    return None


def direction(name: str) -> tuple[int, frozenset[str]]:
    """Return +1, −1 or 0 for the direction that a name tells, and its other words."""
    in_order = words(name)
    # "coil_B [A]" is the current of side B
    if in_order[-1:] == ["a"] and "b" in in_order:
        in_order.pop()
    in_name = frozenset(in_order)
    for positive, negative in CLUES["opposite"]:
        told = {positive, negative} & in_name
        if told:
            # 0 of a name that holds both
            sign = (positive in told) - (negative in told)
            return sign, in_name - told
    return 0, in_name
