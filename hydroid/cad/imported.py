"""What an import yields: a serial arm in hydroid's frames.

Every frame has its origin in the link's joint and is parallel to the world's at joint angles 0.
"""

from dataclasses import dataclass

import numpy as np
import trimesh
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ImportedLink:
    """A link with all that is fixed to it.

    Attributes:
        name: a plain word.
        mass: [kg].
        centre: of mass [m], shape (3,).
        tensor: inertia about it [kg·m²], shape (3, 3).
        mesh: what it looks like [m]; None: nothing is known.
        bodies: names of the file's bodies that it is made of.
    """

    name: str
    mass: float
    centre: Array
    tensor: Array
    mesh: trimesh.Trimesh | None
    bodies: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class ImportedJoint:
    """A hinge.

    Attributes:
        name: a plain word.
        axis: direction in the parent link's frame, shape (3,).
        at: position there [m], shape (3,).
        range: smallest and largest angle [deg].
        continuous: whether it has no limits.
    """

    name: str
    axis: Array
    at: Array
    range: tuple[float, float]
    continuous: bool


@dataclass(frozen=True, eq=False)
class ImportedArm:
    """A serial arm; `links[i]` hangs on `links[i - 1]` by `joints[i]`.

    Attributes:
        name: of the robot.
        base: what its base looks like, in the world's frame [m]; None: nothing is known.
        links, joints: from the base outwards.
        notes: what was assumed, left out or mended, a line each.
    """

    name: str
    base: trimesh.Trimesh | None
    links: tuple[ImportedLink, ...]
    joints: tuple[ImportedJoint, ...]
    notes: tuple[str, ...]
