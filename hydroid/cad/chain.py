"""Which joints of a robot are the arm: those from its base to one of its ends;
all others are held."""

from collections.abc import Collection, Mapping, Sequence
from pathlib import Path

import mujoco

from hydroid.cad.pins import ends_of, is_part_of_cylinder
from hydroid.cad.source import Notes
from hydroid.errors import ModelError
from hydroid.log.clues import joint_of, words
from hydroid.words import listed

FINGERS = {"finger", "fingers", "jaw", "jaws", "claw", "claws", "knuckle", "fingertip"}
SIDES = {"left", "right", "l", "r"}


def choose_chain(
    spec: mujoco.MjSpec,
    path: Path,
    notes: Notes,
    columns: Sequence[str],
    tip: str | None,
) -> None:
    """Choose the joints from the base to `tip`, or else to the tip that fits best,
    and delete the others.

    The best tip is the one with the most joints that the columns of a log name, then
    the one with the most joints, then the first. Rods and tubes of cylinders are no
    tips, nor are fingers that the log does not name. What is left out is held, and its
    mass belongs to the link that carries it.

    Raises:
        ModelError: no joint can be moved, a body has several, or no joint moves `tip`.
    """
    _hold(spec, notes)
    tips = _tips(spec, path)
    if tip is None:
        chain, why = _best(spec, tips, columns)
    else:
        link = spec.body(tip)
        chain = ()
        if link is not None:
            chain = _path(link)
        why = "as asked"
        if not chain:
            raise ModelError(
                f"no joint moves a link {tip!r}", path, f"tips: {', '.join(tips)}"
            )
    left_out = [joint for joint in spec.joints if joint.name not in chain]
    if left_out:
        others = [f"--tip {link}" for link, other in tips.items() if other != chain]
        held = _held(spec, left_out, columns)
        notes.add(
            f"the arm is {' - '.join(chain)} ({why}); held at 0, on no way to its end: {held}. "
            f"Other ends: {listed(others, 6) or 'none'}"
        )
    for joint in left_out:
        spec.delete(joint)


def _held(
    spec: mujoco.MjSpec, joints: Sequence[mujoco.MjsJoint], columns: Sequence[str]
) -> str:
    """Return which joints are held, and loudly those that a log names."""
    names = [joint.name for joint in joints]
    named = [name for name in names if _named(spec, [name], columns)]
    warning = f"; THE LOG NAMES {', '.join(named)}" if named else ""
    return f"{listed(names, 12)}{warning}"


def _tips(spec: mujoco.MjSpec, path: Path) -> dict[str, tuple[str, ...]]:
    """Return the joints from the base to each link that carries no further joint, by
    the link."""
    chains: dict[str, tuple[str, ...]] = {}
    for joint in spec.joints:
        if len(joint.parent.joints) > 1:
            hint = "put a small body between them: hydroid moves one joint per link"
            raise ModelError(
                f"body {joint.parent.name!r} has several joints", path, hint
            )
        chains[joint.parent.name] = _path(joint.parent)
    inner = set[str]()
    for chain in chains.values():
        inner.update(chain[:-1])
    tips = {link: chain for link, chain in chains.items() if chain[-1] not in inner}
    if not tips:
        raise ModelError("has no joint that hydroid could move", path)
    return tips


def _best(
    spec: mujoco.MjSpec, tips: Mapping[str, tuple[str, ...]], columns: Sequence[str]
) -> tuple[tuple[str, ...], str]:
    """Return the chain that fits the columns of a log best, and why it is taken."""
    arms = [_without_fingers(spec, chain, columns) for chain in tips.values()]
    best = max(arms, key=lambda chain: (_named(spec, chain, columns), len(chain)))
    if _named(spec, best, columns):
        return best, "the log names most of its joints"
    return best, "the longest branch"


def _without_fingers(
    spec: mujoco.MjSpec, chain: tuple[str, ...], columns: Sequence[str]
) -> tuple[str, ...]:
    """Return a chain without the fingers at its end that no column names: they grip,
    and are no arm."""
    while len(chain) > 1 and _is_finger(spec, chain[-1]):
        if _named(spec, chain[-1:], columns):
            break
        chain = chain[:-1]
    return chain


def _is_finger(spec: mujoco.MjSpec, name: str) -> bool:
    """Return whether a joint's name or its link's says so,
    or another beside it differs by its side only."""
    joint = spec.joint(name)
    in_names = {*words(joint.name), *words(joint.parent.name)}
    if in_names & FINGERS:
        return True
    above = joint.parent.parent
    for other in spec.joints:
        is_beside = other.parent.parent == above and other.name != name
        if is_beside and _without_side(other.name) == _without_side(name):
            return True
    return False


def _without_side(name: str) -> tuple[str, ...]:
    return tuple(
        word for word in words(name) if word not in SIDES and not word.isdecimal()
    )


def _hold(spec: mujoco.MjSpec, notes: Notes) -> None:
    """Delete the joints that hydroid does not move, or that follow others, and say
    so."""
    followers = {e.name1 for e in spec.equalities if e.type == mujoco.mjtEq.mjEQ_JOINT}
    for joint in list(spec.joints):
        if joint.type == mujoco.mjtJoint.mjJNT_FREE:
            notes.add(
                "free to float in the file: fixed to the world", joint.parent.name
            )
            spec.delete(joint)
            continue
        why = _why_held(joint, followers)
        if why:
            notes.add(why, joint.name)
            spec.delete(joint)
    for equality in spec.equalities:
        if equality.type != mujoco.mjtEq.mjEQ_JOINT:
            kind = equality.type.name.removeprefix("mjEQ_").lower()
            what = f"a {kind} of the file ties them, which hydroid does not simulate: left out"
            notes.add(what, *ends_of(spec, equality))
    for part in (*spec.equalities, *spec.actuators, *spec.tendons):
        spec.delete(part)


def _why_held(joint: mujoco.MjsJoint, followers: Collection[str]) -> str:
    """Return why hydroid does not move a joint; empty where it does."""
    if joint.name in followers:
        return "following another joint, which hydroid does not model: held at 0"
    if joint.type == mujoco.mjtJoint.mjJNT_BALL:
        return "a ball joint, which hydroid does not model: held at 0"
    if is_part_of_cylinder(joint):
        return "part of a cylinder that the file pins at one end: held. Give both pivots in arm.yaml"
    return ""


def _path(body: mujoco.MjsBody | None) -> tuple[str, ...]:
    """Return the names of the joints from the world to a body."""
    if body is None:
        return ()
    own = tuple(joint.name for joint in body.joints)
    return _path(body.parent) + own


def _named(spec: mujoco.MjSpec, chain: Sequence[str], columns: Sequence[str]) -> int:
    """Return how many of the chain's joints, or of their links, are named by
    columns."""
    names = [joint.name for joint in spec.joints]
    links = [joint.parent.name for joint in spec.joints]
    named = set[int | None]()
    for column in columns:
        named |= {joint_of(column, names), joint_of(column, links)}
    return sum(names.index(name) + 1 in named for name in chain)
