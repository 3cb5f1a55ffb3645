"""What an arm's bodies look like and weigh: base, links, parts bolted to them, and the place of a payload.

Every frame has its origin in the body's joint and is parallel to the world's at joint angles 0.
"""

from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, Strict, model_validator

from hydroid.settings.linkage import Vector
from hydroid.settings.load import Positive, Settings

Name = Annotated[str, Field(pattern=r"^[A-Za-z_][A-Za-z0-9_]*$")]

INERTIA_SLACK = 1e-6
"""part of the largest moment by which two others may miss it, since exports round"""


class Box(Settings):
    """A block along the axes of the link's frame."""

    kind: Literal["box"]
    """box: a block along the axes of the link's frame"""
    size: tuple[Positive, Positive, Positive]
    """lengths along x, y and z [m]"""
    at: Vector = (0.0, 0.0, 0.0)
    """position of its centre in the link's frame [m]"""


class Cylinder(Settings):
    """A round bar."""

    kind: Literal["cylinder"]
    """cylinder: a round bar"""
    ends: tuple[Vector, Vector]
    """positions of the centres of both end faces in the link's frame [m]"""
    radius: Positive
    """radius [m]"""

    @model_validator(mode="after")
    def _long(self) -> "Cylinder":
        if self.ends[0] == self.ends[1]:
            raise ValueError("ends must be two different points")
        return self


class Inertia(Settings):
    """Where a link's mass is and how it is spread, as CAD states it for the nominal mass."""

    centre: Vector
    """centre of mass in the link's frame [m]"""
    tensor: tuple[float, float, float, float, float, float]
    """inertia about the centre of mass, along the axes of the link's frame: xx, yy, zz, xy, xz, yz [kg·m²]"""

    @model_validator(mode="after")
    def _possible(self) -> "Inertia":
        if fault := inertia_fault(self.matrix):
            raise ValueError(fault)
        return self

    @property
    def matrix(self) -> NDArray[np.float64]:
        """The tensor [kg·m²], shape (3, 3)."""
        xx, yy, zz, xy, xz, yz = self.tensor
        return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def inertia_fault(tensor: NDArray[np.float64]) -> str:
    """Return why no rigid body has this inertia [kg·m²], shape (3, 3); empty: one has."""
    if not np.isfinite(tensor).all():
        return "its inertia is not finite"
    a, b, c = np.linalg.eigvalsh(tensor).tolist()
    if a <= 0:
        return f"its smallest moment of inertia is {a:.3g} kg·m², and must be above 0"
    if a + b < c * (1 - INERTIA_SLACK):
        return f"its moments of inertia {a:.3g}, {b:.3g} and {c:.3g} kg·m² break A + B ≥ C"
    return ""


class Base(Settings):
    """The fixed base that carries the first joint."""

    mesh: str | None = None
    """STL file in the folder of the meshes; null: nothing is shown"""
    at: Vector = (0.0, 0.0, 0.0)
    """position of the base's frame in the world [m]"""


class Link(Settings):
    """A moving link; the origin of its mesh lies in its joint."""

    name: Name
    """name of the link"""
    mesh: str | None = None
    """STL file in the folder of the meshes; null: the link has a shape, or is not shown"""
    shape: Annotated[Box | Cylinder, Field(discriminator="kind")] | None = None
    """block or round bar in place of a mesh"""
    mass: Positive
    """nominal mass [kg]"""
    inertia: Inertia | None = None
    """centre of mass and inertia; null: those of the mesh or the shape at uniform density"""

    @model_validator(mode="after")
    def _has_inertia(self) -> "Link":
        if self.mesh is not None and self.shape is not None:
            raise ValueError(f"{self.name} has a mesh and a shape; give one of them")
        if self.mesh is None and self.shape is None and self.inertia is None:
            raise ValueError(f"{self.name} needs a mesh, a shape or an inertia")
        return self


class FixedPart(Link):
    """A part bolted to a link, such as a fixed jaw or a tool."""

    carried_by: Name
    """name of the link that carries the part"""
    at: Vector = (0.0, 0.0, 0.0)
    """position in the frame of that link [m]"""


class PayloadPlace(Settings):
    """Where the gripper holds the mass that a log's `payloads` names."""

    carried_by: Name
    """name of the link that carries the payload"""
    at: Vector
    """position of its centre of mass in the frame of that link [m]"""


class Pair(Settings):
    """A machine with two of these arms, which mirror each other in the plane y = 0, on one carrier."""

    model: Annotated[Path, Strict(False)]
    """the MJCF of the machine, written by `hydroid build-model`; relative to this file"""
    carrier: tuple[str, ...] = ()
    """STL files of the carrier in the folder of the meshes, in the world's frame; each collides as its convex
    hull"""
    at: Vector
    """position of the right arm's base in the world [m]; the left one stands at the same place with -y"""

    @model_validator(mode="after")
    def _apart(self) -> "Pair":
        if self.at[1] >= 0:
            raise ValueError("at: y must be negative, on the right of a machine that looks along x")
        return self
