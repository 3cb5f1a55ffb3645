"""Which of a robot's joints are the arm: the hinges from the base to one tip."""

import re
from collections.abc import Sequence

import mujoco

from hydroid.errors import ModelError


def choose_chain(
    spec: mujoco.MjSpec, where: str, notes: list[str], columns: Sequence[str] = (), tip: str | None = None
) -> None:
    """Choose the hinges from the base to `tip`, or else to the tip that fits best, and delete the others.

    The best tip is the one with the most joints that the columns of a log name, then the one with the most
    joints, then the first. A branch that is left out is held, and its mass belongs to the link that carries
    it.

    Raises:
        ModelError: no hinge, a body with several, or no such tip.
    """
    chains: dict[str, tuple[str, ...]] = {}
    for joint in spec.joints:
        if len(joint.parent.joints) > 1:
            hint = "put a small body between them: hydroid moves one joint per link"
            raise ModelError(f"body {joint.parent.name!r} has several hinges", where=where, hint=hint)
        chains[joint.parent.name] = _path(joint.parent)
    inner = {name for chain in chains.values() for name in chain[:-1]}
    tips = {link: chain for link, chain in chains.items() if chain[-1] not in inner}
    if not tips:
        raise ModelError("has no hinge that hydroid could move", where=where)
    if tip is None:
        wanted = max(tips.values(), key=lambda chain: (_named(spec, chain, columns), len(chain)))
        why = "named in the log" if _named(spec, wanted, columns) else "the longest branch"
    else:
        link, why = spec.body(tip), "as asked"
        wanted = () if link is None else _path(link)
        if not wanted:
            raise ModelError(f"no joint moves a link {tip!r}", where=where, hint=f"tips: {', '.join(tips)}")
    left = [joint for joint in spec.joints if joint.name not in wanted]
    if left:
        notes.append(
            f"of {len(tips)} branches the arm is {' - '.join(wanted)} ({why}); held at 0: "
            f"{', '.join(joint.name for joint in left)}. Choose another with --tip: {', '.join(tips)}"
        )
    for joint in left:
        spec.delete(joint)


def _path(body: mujoco.MjsBody | None) -> tuple[str, ...]:
    """The joints from the base to a body."""
    return () if body is None else (*_path(body.parent), *(joint.name for joint in body.joints))


def _named(spec: mujoco.MjSpec, chain: Sequence[str], columns: Sequence[str]) -> int:
    """Number of the chain's joints whose name, or whose link's, stands in the name of a column."""
    text = [_bare(column) for column in columns]
    pairs = [(_bare(name), _bare(spec.joint(name).parent.name)) for name in chain]
    return sum(any(n and n in column for n in pair for column in text) for pair in pairs)


def _bare(name: str) -> str:
    return re.sub(r"(joint|link|[^a-z0-9])", "", name.lower())
