"""Make the meshes of the example's excavator: one watertight STL per part, in m, origin in its joint.

    python examples/excavator/make_meshes.py

The shapes are ours: simple blocks of the size of a 20 t machine. Nothing of the logged machine was measured.
"""

import sys
from collections.abc import Callable
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2] / "meshes"))

from shapes import both, box, canonical, join, plate, rod
from trimesh import Trimesh


def base() -> Trimesh:
    """Undercarriage with two tracks, below the slewing ring."""
    track = plate("y", (0.95, 1.45), (-0.6, -1.6, 0.4), (-0.6, 1.6, 0.4))
    return join(
        both(track), box((-0.7, -1.0, -0.7), (0.7, 1.0, -0.2)), rod("z", (0.0, 0.0), (-0.3, 0.0), 0.6)
    )


def house() -> Trimesh:
    """Upper structure: deck, engine, cab, counterweight."""
    deck = box((-1.9, -1.25, 0.05), (0.9, 1.25, 0.35))
    engine = box((-1.9, -1.25, 0.3), (-0.4, 1.25, 1.2))
    cab = box((-0.4, 0.35, 0.3), (0.9, 1.25, 1.8))
    weight = plate("z", (0.1, 1.1), (-1.9, -0.7, 0.5), (-1.9, 0.7, 0.5))
    cheek = plate("y", (0.24, 0.3), (0.3, -0.1, 0.2), (0.7, 0.1, 0.15))
    return join(deck, engine, cab, weight, both(cheek))


def boom() -> Trimesh:
    """Bent boom, 4.6 m from foot to arm joint."""
    lower = plate("y", (-0.2, 0.2), (0.0, 0.0, 0.15), (0.5, 2.0, 0.32))
    upper = plate("y", (-0.2, 0.2), (0.5, 2.0, 0.32), (0.0, 4.6, 0.16))
    return join(lower, upper)


def arm() -> Trimesh:
    """Arm, 2.4 m, which hangs down at angle 0."""
    return plate("y", (-0.16, 0.16), (0.35, -0.1, 0.12), (0.0, 0.0, 0.2), (-2.4, 0.0, 0.12))


def bucket() -> Trimesh:
    """Bucket, curled under the arm at angle 0."""
    back = plate("y", (-0.5, 0.5), (0.0, 0.0, 0.12), (-0.35, -0.1, 0.12), (-0.3, -0.8, 0.06))
    floor = plate("y", (-0.5, 0.5), (-0.3, -0.8, 0.06), (0.05, -1.25, 0.03))
    return join(back, floor)


PARTS: tuple[Callable[[], Trimesh], ...] = (base, house, boom, arm, bucket)


def main(folder: Path) -> None:
    """Write every part to `folder`."""
    for part in PARTS:
        solid = canonical(part())
        if not solid.is_watertight or solid.volume <= 0:
            raise SystemExit(f"{part.__name__} is not watertight")
        data = solid.export(file_type="stl")
        assert isinstance(data, bytes)
        (folder / f"{part.__name__}.stl").write_bytes(data)
        print(f"{part.__name__:10} {len(solid.faces):5} faces  {solid.volume:.2f} m³")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent / "meshes")
