"""Which of a robot's joints are the arm: those from the base to one tip."""

from collections.abc import Sequence

import mujoco

from hydroid.cad.cylinders import is_part_of_cylinder
from hydroid.cad.source import Notes
from hydroid.errors import ModelError
from hydroid.log.clues import joint_of
from hydroid.words import listed


def choose_chain(
    spec: mujoco.MjSpec, where: str, notes: Notes, columns: Sequence[str] = (), tip: str | None = None
) -> None:
    """Choose the joints from the base to `tip`, or else to the tip that fits best, and delete the others.

    The best tip is the one with the most joints that the columns of a log name, then the one with the most
    joints, then the first. Rods and tubes of cylinders are no tips. What is left out is held, and its mass
    belongs to the link that carries it.
    Raises ModelError: no joint, a body with several, or no such tip.
    """
    _hold(spec, notes)
    chains: dict[str, tuple[str, ...]] = {}
    for joint in spec.joints:
        if len(joint.parent.joints) > 1:
            hint = "put a small body between them: hydroid moves one joint per link"
            raise ModelError(f"body {joint.parent.name!r} has several joints", where, hint)
        chains[joint.parent.name] = _path(joint.parent)
    inner = {name for chain in chains.values() for name in chain[:-1]}
    tips = {link: chain for link, chain in chains.items() if chain[-1] not in inner}
    if not tips:
        raise ModelError("has no joint that hydroid could move", where)
    if tip is None:
        wanted = max(tips.values(), key=lambda chain: (_named(spec, chain, columns), len(chain)))
        why = "the log names most of its joints" if _named(spec, wanted, columns) else "the longest branch"
    else:
        link, why = spec.body(tip), "as asked"
        wanted = () if link is None else _path(link)
        if not wanted:
            raise ModelError(f"no joint moves a link {tip!r}", where, f"tips: {', '.join(tips)}")
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
    for section in (spec.equalities, spec.actuators, spec.tendons):
        for part in list(section):
            spec.delete(part)


def _path(body: mujoco.MjsBody | None) -> tuple[str, ...]:
    return () if body is None else (*_path(body.parent), *(joint.name for joint in body.joints))


def _named(spec: mujoco.MjSpec, chain: Sequence[str], columns: Sequence[str]) -> int:
    """Number of the chain's joints whose name, or whose link's, stands in the name of a column."""
    names = [joint.name for joint in spec.joints]
    links = [joint.parent.name for joint in spec.joints]
    hits = {joint_of(column, of) for column in columns for of in (names, links)} - {None}
    return sum(names.index(name) + 1 in hits for name in chain)
