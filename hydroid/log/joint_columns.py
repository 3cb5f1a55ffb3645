"""Which column belongs to which joint: by its name or its number, or else in order."""

from collections.abc import Hashable, Iterator, Mapping, Sequence
from typing import NamedTuple

from hydroid.arrays import Limits, record
from hydroid.log.clues import direction, joint_of, number_in, words
from hydroid.log.columns import Column
from hydroid.log.rods import Rod
from hydroid.settings.log import LENGTHS
from hydroid.words import listed

USELESS = "left out, lengths of cylinders whose pivots are not known"
NEEDED = "give both of each in arm.yaml, and lengths stand for angles"


@record
class Joints:
    """What is known of the joints whose columns are sought, by number from 1.

    Attributes:
        names: of the joints.
        links: that they move, whose names columns may have instead; empty: not known.
        slides: joints whose positions are in m.
        rods: cylinders whose lengths may stand for the angles of their joints.
        ranges: from which to which angle a joint can go [rad, m].
    """

    names: Sequence[str]
    links: Sequence[str]
    slides: Sequence[int]
    rods: Mapping[int, Rod]
    ranges: Mapping[int, Limits]

    def named_in(self, column: str) -> int:
        """Return the joint whose name, or whose link's, a column's name holds; 0:
        none."""
        return joint_of(column, self.names) or joint_of(column, self.links) or 0

    def can_have(self, joint: int, column: Column) -> bool:
        """Return whether a column may hold the position of a joint that slides or
        turns, with a cylinder whose pivots are known or without."""
        # its meaning is found by its numbers later
        if column.is_raw:
            return True
        if joint in self.slides:
            return not column.unit or column.unit in LENGTHS
        return joint in self.rods or not column.is_length


class Assignment(NamedTuple):
    """The column of a joint, or the two for the directions of its command, and what
    says that they are its."""

    columns: Sequence[Column]
    reason: str


def by_joint(
    columns: Sequence[Column], joints: Joints, reasons: list[str]
) -> dict[int, Assignment]:
    """Give columns of one kind to the joints; add what is uncertain or left out to the
    reasons.

    Where no column says whose it is, they are given to the joints in order.
    """
    assigned = dict[int, Assignment]()
    groups = _groups(columns, joints.names)
    from_zero = any(number_in(column.name) == 0 for column in columns)
    left = list[Sequence[Column]]()
    for group in groups:
        joint, reason = _joint_in(group[0].name, joints, from_zero=from_zero)
        if _may_have(joint, group, joints, assigned):
            assigned[joint] = Assignment(group, reason)
        else:
            left.append(group)
    left = _without_lengths(left, joints, assigned, reasons, from_zero=from_zero)
    if assigned and from_zero:
        reasons.append("the numbers in the names count from 0: joint 1 is number 0")
    # beside columns that have a joint the order says nothing
    if not assigned:
        left = _given_in_order(left, joints, assigned)
    if left:
        reasons.append(_left_out(left, joints, assigned))
    return assigned


def _groups(columns: Sequence[Column], joints: Sequence[str]) -> list[Sequence[Column]]:
    """Return columns alone, and those for two directions of a command together, the
    positive one first."""
    in_joints = {word for joint in joints for word in words(joint)}
    groups = dict[Hashable, list[Column]]()
    for column in columns:
        sign, other_words = direction(column.name)
        key: Hashable = column.name
        # the left boom's command is not one to the left
        told = {*words(column.name)} - other_words
        if sign and column.kind == "command" and told.isdisjoint(in_joints):
            key = other_words
        groups.setdefault(key, []).append(column)
    for group in groups.values():
        group.sort(key=lambda column: -direction(column.name)[0])
    # of more than two it cannot be known which belong together
    return [group[:2] for group in groups.values()]


def _joint_in(name: str, joints: Joints, *, from_zero: bool) -> tuple[int, str]:
    """Return the joint that the name of a column tells, 0 if none, and by what."""
    joint = joints.named_in(name)
    if joint:
        return joint, "by its name"
    number = number_in(name)
    if number is None:
        return 0, "by its number"
    if from_zero:
        number += 1
    return number, "by its number"


def _may_have(
    joint: int,
    group: Sequence[Column],
    joints: Joints,
    assigned: Mapping[int, Assignment],
) -> bool:
    """Return whether a joint exists, has no columns yet, and moves in the unit of
    these."""
    if not 0 < joint <= len(joints.names) or joint in assigned:
        return False
    return group[0].kind == "command" or joints.can_have(joint, group[0])


def _given_in_order(
    groups: Sequence[Sequence[Column]],
    joints: Joints,
    assigned: dict[int, Assignment],
) -> list[Sequence[Column]]:
    """Give each group to the first joint that may have it; return the others."""
    left = list[Sequence[Column]]()
    for group in groups:
        for joint in range(1, len(joints.names) + 1):
            if _may_have(joint, group, joints, assigned):
                reason = "by its place in the log: check it"
                assigned[joint] = Assignment(group, reason)
                break
        else:
            left.append(group)
    return left


def _without_lengths(
    left: Sequence[Sequence[Column]],
    joints: Joints,
    assigned: Mapping[int, Assignment],
    reasons: list[str],
    *,
    from_zero: bool,
) -> list[Sequence[Column]]:
    """Return the columns that are no lengths of the cylinders of joints without other
    columns; add those that are to the reasons.

    Without the pivots of its cylinder a length tells no angle of a joint.
    """
    others = list[Sequence[Column]]()
    useless = list[str]()
    for group in left:
        first = group[0]
        joint, _ = _joint_in(first.name, joints, from_zero=from_zero)
        if (
            first.kind == "angle"
            and first.is_length
            and joint
            and joint not in assigned
        ):
            useless.append(first.name)
        else:
            others.append(group)
    if useless:
        reasons.append(f"{USELESS}: {listed(useless, 12)}: {NEEDED}")
    return others


def _left_out(
    left: Sequence[Sequence[Column]],
    joints: Joints,
    assigned: Mapping[int, Assignment],
) -> str:
    """Return the sentence about columns that no joint has."""
    names = list[str]()
    for group in left:
        names += [column.name for column in group]
    kind = left[0][0].kind
    free = list[str]()
    for joint, name in enumerate(joints.names, 1):
        if joint not in assigned:
            free.append(name)
    whose = "every joint has one already"
    taken = [*_taken_instead(left, joints, assigned)]
    if len(taken) == len(left):
        whose = listed(taken, 12)
    elif free:
        whose = f"whose {kind} is it: {' or '.join(free)}?"
    spare = listed(names, 12)
    return f"left out, though like a joint's {kind}: {spare}; {whose}"


def _taken_instead(
    left: Sequence[Sequence[Column]],
    joints: Joints,
    assigned: Mapping[int, Assignment],
) -> Iterator[str]:
    """Yield which column a joint has whose name one that is left out holds, too."""
    for group in left:
        joint = joints.named_in(group[0].name)
        if joint in assigned:
            columns = [column.name for column in assigned[joint].columns]
            yield f"{joints.names[joint - 1]} has {' and '.join(columns)}"
