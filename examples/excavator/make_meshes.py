"""Make the meshes of the example's excavator: one watertight STL per part, in m, origin
in its joint.

    python examples/excavator/make_meshes.py

The distances between the joints are those of the logs' authors; the shapes are ours:
simple blocks of the size of a 7 t machine. x runs along boom, arm and bucket.
"""

import sys
from collections.abc import Callable
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2] / "meshes"))

from shapes import both, box, canonical, join, plate, rod
from trimesh import Trimesh


def base() -> Trimesh:
    """Undercarriage with two tracks, below the slewing ring."""
    track = plate("y", (0.7, 1.1), (-0.4, -1.1, 0.3), (-0.4, 1.1, 0.3))
    return join(
        both(track),
        box((-0.5, -0.75, -0.5), (0.5, 0.75, -0.12)),
        rod("z", (0.0, 0.0), (-0.2, 0.0), 0.45),
    )


def house() -> Trimesh:
    """Upper structure: deck, engine, cab, counterweight."""
    deck = box((-1.5, -1.0, 0.05), (0.5, 1.0, 0.3))
    engine = box((-1.5, -1.0, 0.25), (-0.4, 1.0, 1.0))
    cab = box((-0.5, 0.15, 0.25), (0.5, 1.0, 1.6))
    weight = plate("z", (0.1, 0.9), (-1.4, -0.6, 0.35), (-1.4, 0.6, 0.35))
    cheek = plate(
        "y", (-0.3, -0.24), (0.5, 0.0, 0.2), (0.2, 0.1, 0.15), (0.15, 0.45, 0.1)
    )
    return join(
        deck,
        engine,
        cab,
        weight,
        cheek,
        cheek.copy().apply_translation((0.0, 0.34, 0.0)),
    )


def boom() -> Trimesh:
    """Bent boom; the arm's joint lies 3.6957 m from its foot."""
    lower = plate("y", (-0.13, 0.13), (0.0, 0.0, 0.12), (0.35, 1.6, 0.26))
    upper = plate("y", (-0.13, 0.13), (0.35, 1.6, 0.26), (0.0, 3.6957, 0.12))
    return join(lower, upper)


def arm() -> Trimesh:
    """Arm; the bucket's joint lies 1.6223 m from its own. Its cylinder pushes the rear
    end."""
    return plate(
        "y",
        (-0.11, 0.11),
        (0.05, -0.36, 0.08),
        (0.15, 0.1, 0.14),
        (0.0, 0.0, 0.15),
        (0.0, 1.6223, 0.08),
    )


def bucket() -> Trimesh:
    """Bucket, stretched out beyond the arm at angle 0, its mouth below."""
    back = plate(
        "y", (-0.35, 0.35), (0.0, 0.0, 0.1), (0.28, 0.2, 0.1), (0.2, 0.6, 0.04)
    )
    floor = plate("y", (-0.35, 0.35), (0.2, 0.6, 0.04), (-0.05, 0.95, 0.02))
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
