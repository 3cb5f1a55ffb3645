"""Which of a robot's joints are the arm: the hinges from the base to one tip."""

import re
from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from hydroid.cad.source import Source
from hydroid.errors import ModelError


@dataclass(frozen=True)
class Chain:
    """A serial arm within a robot.

    Attributes:
        joints: numbers of the model's joints, from the base outwards.
        bodies: numbers of the bodies that they move.
        carrier: of every body, the position in the chain of the link that it is part of; -1: the base.
    """

    joints: tuple[int, ...]
    bodies: tuple[int, ...]
    carrier: tuple[int, ...]


def choose_chain(
    source: Source, model: mujoco.MjModel, columns: Sequence[str] = (), tip: str | None = None
) -> Chain:
    """Choose the hinges from the base to `tip`, or else to the tip that fits best.

    The best tip is the one with the most joints that the columns of a log name, then the one with the most
    joints, then the first. A branch that is left out is held at 0, and its mass belongs to the link that
    carries it.

    Raises:
        ModelError: no hinge, a body with several, or no such tip.
    """
    where = str(source.path)
    hinges = _hinges(source, model)
    chains = {body: _path(model, body, hinges) for body in hinges}
    inner = {body for chain in chains.values() for body in chain[:-1]}
    tips = {model.body(body).name: chain for body, chain in chains.items() if body not in inner}
    if not tips:
        raise ModelError("has no hinge that hydroid could move", where=where)
    if tip is not None:
        body = next((b for b in range(model.nbody) if model.body(b).name == tip), None)
        wanted = () if body is None else _path(model, body, hinges)
        if not wanted:
            raise ModelError(f"no joint moves a link {tip!r}", where=where, hint=f"tips: {', '.join(tips)}")
    else:
        wanted = max(tips.values(), key=lambda chain: (_named(model, chain, hinges, columns), len(chain)))
    if len(tips) > 1 or tip is not None:
        left = [model.joint(hinges[body]).name for body in hinges if body not in wanted]
        chosen = " - ".join(model.joint(hinges[body]).name for body in wanted)
        why = "as asked" if tip is not None else "named in the log" if _named(
            model, wanted, hinges, columns
        ) else "the longest branch"  # fmt: skip
        if left:
            source.notes.append(
                f"of {len(tips)} branches the arm is {chosen} ({why}); held at 0: {', '.join(left)}. Choose "
                f"another with --tip: {', '.join(tips)}"
            )
    carrier = [-1] * model.nbody
    for body in range(1, model.nbody):
        parent = carrier[model.body_parentid[body]]
        carrier[body] = wanted.index(body) if body in wanted else parent
    return Chain(tuple(hinges[body] for body in wanted), wanted, tuple(carrier))


def _hinges(source: Source, model: mujoco.MjModel) -> dict[int, int]:
    """The hinge of every body that hydroid could move."""
    hinges: dict[int, int] = {}
    for joint in range(model.njnt):
        body, name = int(model.jnt_bodyid[joint]), model.joint(joint).name
        if model.jnt_type[joint] != mujoco.mjtJoint.mjJNT_HINGE or name in source.held:
            continue
        if body in hinges:
            hint = "put a small body between them: hydroid moves one joint per link"
            what = f"body {model.body(body).name!r} has several hinges"
            raise ModelError(what, where=str(source.path), hint=hint)
        hinges[body] = joint
    return hinges


def _path(model: mujoco.MjModel, body: int, hinges: dict[int, int]) -> tuple[int, ...]:
    """The bodies with a hinge from the base to a body."""
    path: list[int] = []
    while body:
        path += [body] if body in hinges else []
        body = int(model.body_parentid[body])
    return tuple(reversed(path))


def _named(
    model: mujoco.MjModel, chain: Sequence[int], hinges: dict[int, int], columns: Sequence[str]
) -> int:
    """Number of the chain's joints whose name, or whose link's, stands in the name of a column."""
    text = [_bare(column) for column in columns]
    names = [(_bare(model.joint(hinges[b]).name), _bare(model.body(b).name)) for b in chain]
    return int(np.sum([any(n and n in column for n in pair for column in text) for pair in names]))


def _bare(name: str) -> str:
    return re.sub(r"(joint|link|[^a-z0-9])", "", name.lower())
