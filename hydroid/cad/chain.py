"""Which joints of a robot are the arm: those from its base to one of its ends;
all others are held."""

from collections.abc import Sequence
from pathlib import Path

import mujoco

from hydroid.cad.cylinders import ends_of, is_part_of_cylinder
from hydroid.cad.source import Notes
from hydroid.errors import ModelError
from hydroid.log.clues import joint_of, words
from hydroid.words import listed

FINGERS = {"finger", "fingers", "jaw", "jaws", "claw", "claws", "knuckle", "fingertip"}
SIDES = {"left", "right", "l", "r"}


def choose_chain(
    spec: mujoco.MjSpec, path: Path, notes: Notes, columns: Sequence[str], tip: str | None
) -> None:
    """Choose the joints from the base to `tip`, or else to the tip that fits best,
    and delete the others.

    The best tip is the one with the most joints that the columns of a log name, then the one with
    the most joints, then the first. Rods and tubes of cylinders are no tips, nor are fingers that
    the log does not name. What is left out is held,
    and its mass belongs to the link that carries it.
    """
    _hold(spec, notes)
    chains: dict[str, tuple[str, ...]] = {}
    for joint in spec.joints:
        if len(joint.parent.joints) > 1:
            hint = "put a small body between them: hydroid moves one joint per link"
            raise ModelError(f"body {joint.parent.name!r} has several joints", path, hint)
        chains[joint.parent.name] = _path(joint.parent)
    inner = {name for chain in chains.values() for name in chain[:-1]}
    tips = {link: chain for link, chain in chains.items() if chain[-1] not in inner}
    if not tips:
        raise ModelError("has no joint that hydroid could move", path)
    if tip is None:
        arms = [_without_fingers(spec, chain, columns) for chain in tips.values()]
        wanted = max(arms, key=lambda chain: (_named(spec, chain, columns), len(chain)))
        why = "the log names most of its joints" if _named(spec, wanted, columns) else "the longest branch"
    else:
        link, why = spec.body(tip), "as asked"
        wanted = () if link is None else _path(link)
        if not wanted:
            raise ModelError(f"no joint moves a link {tip!r}", path, f"tips: {', '.join(tips)}")
    left = [joint for joint in spec.joints if joint.name not in wanted]
    if left:
        others = listed([f"--tip {link}" for link, chain in tips.items() if chain != wanted], 6)
        named = [joint.name for joint in left if _named(spec, [joint.name], columns)]
        warning = f"; THE LOG NAMES {', '.join(named)}" if named else ""
        held = listed([joint.name for joint in left], 12)
        notes.add(
            f"the arm is {' - '.join(wanted)} ({why}); held at 0, on no way to its end: {held}{warning}. "
            f"Other ends: {others or 'none'}"
        )
    for joint in left:
        spec.delete(joint)


def _without_fingers(spec: mujoco.MjSpec, chain: tuple[str, ...], columns: Sequence[str]) -> tuple[str, ...]:
    """Return a chain without the fingers at its end that no column names: they grip,
    and are no arm."""
    while len(chain) > 1 and _is_finger(spec, chain[-1]) and not _named(spec, chain[-1:], columns):
        chain = chain[:-1]
    return chain


def _is_finger(spec: mujoco.MjSpec, name: str) -> bool:
    """Return whether a joint's name or its link's says so,
    or another beside it differs by its side only."""
    joint = spec.joint(name)
    told = {*words(joint.name), *words(joint.parent.name)}
    if told & FINGERS:
        return True
    above = joint.parent.parent
    beside = [other.name for other in spec.joints if other.parent.parent == above and other.name != name]
    return _without_side(name) in map(_without_side, beside)


def _without_side(name: str) -> tuple[str, ...]:
    return tuple(one for one in words(name) if one not in SIDES and not one.isdecimal())


def _hold(spec: mujoco.MjSpec, notes: Notes) -> None:
    """Delete the joints that hydroid does not move, or that follow others, and say so."""
    followers = {e.name1: e.name2 for e in spec.equalities if e.type == mujoco.mjtEq.mjEQ_JOINT}
    for joint in list(spec.joints):
        if joint.type == mujoco.mjtJoint.mjJNT_FREE:
            notes.add("free to float in the file: fixed to the world", joint.parent.name)
        elif joint.name in followers:
            notes.add("following another joint, which hydroid does not model: held at 0", joint.name)
        elif joint.type == mujoco.mjtJoint.mjJNT_BALL:
            notes.add("a ball joint, which hydroid does not model: held at 0", joint.name)
        elif is_part_of_cylinder(joint):
            what = "part of a cylinder that the file pins at one end: held. Give both pivots in arm.yaml"
            notes.add(what, joint.name)
        else:
            continue
        spec.delete(joint)
    for one in spec.equalities:
        if one.type != mujoco.mjtEq.mjEQ_JOINT:
            kind = one.type.name.removeprefix("mjEQ_").lower()
            what = f"a {kind} of the file ties them, which hydroid does not simulate: left out"
            notes.add(what, *ends_of(spec, one))
    for part in (*spec.equalities, *spec.actuators, *spec.tendons):
        spec.delete(part)


def _path(body: mujoco.MjsBody | None) -> tuple[str, ...]:
    return () if body is None else (*_path(body.parent), *(joint.name for joint in body.joints))


def _named(spec: mujoco.MjSpec, chain: Sequence[str], columns: Sequence[str]) -> int:
    """Number of the chain's joints whose name, or whose link's, stands in the name of a column."""
    names = [joint.name for joint in spec.joints]
    links = [joint.parent.name for joint in spec.joints]
    hits = {joint_of(column, of) for column in columns for of in (names, links)} - {None}
    return sum(names.index(name) + 1 in hits for name in chain)
