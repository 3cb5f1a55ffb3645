"""Make the arm's meshes: one watertight STL a part, in m, its origin in the joint that
moves it.

    python meshes/make_meshes.py [FOLDER]

The shapes are ours, not a HydroLek's drawings: a plausible hydraulic arm with the
joints and cylinder pivots of configs/hydrolek.yaml. Beams, housings and posts are
hollow, and what meets in a joint is forked so that cylinders can pass. Needs manifold3d
(`pip install 'hydroid[dev]'`). Running it again gives the same bytes.
"""

import math
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import trimesh
from shapes import beam, bolts, both, box, canonical, cut, join, plate, rod, tube
from trimesh import Trimesh


def base() -> Trimesh:
    """Pedestal with the slewing bearing and the rear bracket of the azimuth
    cylinder."""
    foot = cut(
        box((-0.25, -0.20, -0.80), (0.25, 0.20, -0.78)),
        *(
            rod("z", (x, y), (-0.81, -0.77), 0.012)
            for x in (-0.21, 0.21)
            for y in (-0.16, 0.16)
        ),
    )
    column = cut(
        box((-0.08, -0.08, -0.79), (0.08, 0.08, -0.10)),
        box((-0.072, -0.072, -0.81), (0.072, 0.072, -0.12)),
    )
    rib = trimesh.convex.convex_hull(
        [
            (x, y, z)
            for y in (-0.006, 0.006)
            for x, z in ((0.075, -0.785), (0.22, -0.785), (0.075, -0.60))
        ]
    )
    ribs = [
        rib.copy().apply_transform(
            trimesh.transformations.rotation_matrix(k * math.pi / 2, (0, 0, 1))
        )
        for k in (0, 2)
    ]
    return join(foot, column, *ribs, *seat())


def seat() -> tuple[Trimesh, ...]:
    """What an arm stands on: deck, slewing bearing, and the rear bracket of the azimuth
    cylinder."""
    deck = plate(
        "z",
        (-0.12, -0.10),
        (-0.27, 0.0, 0.045),
        (0.03, -0.05, 0.06),
        (0.03, 0.05, 0.06),
    )
    bearing = tube("z", (0.0, 0.0), (-0.11, -0.056), 0.078, 0.040)
    bracket = join(
        plate("z", (-0.11, -0.052), (-0.25, 0.0, 0.024), (-0.275, 0.0, 0.024)),
        plate("z", (-0.018, -0.004), (-0.25, 0.0, 0.024), (-0.275, 0.0, 0.024)),
        box((-0.299, -0.022, -0.11), (-0.279, 0.022, -0.004)),
        rod("z", (-0.25, 0.0), (-0.06, 0.002), 0.010),
    )
    return deck, bearing, bolts("z", (-0.102, -0.094), 0.088, 0.006, 8), bracket


def carrier_tracks() -> Trimesh:
    """Crawler of the carrier, about as large as a Brokk 40's; the frame lies on the
    floor below both arms."""
    track = plate("y", (0.19, 0.30), (0.13, -0.85, 0.13), (0.13, -0.05, 0.13))
    grouser = [
        box((-0.84 + 0.13 * k, 0.185, 0.0), (-0.81 + 0.13 * k, 0.305, 0.262))
        for k in range(7)
    ]
    wheels = [rod("y", (0.13, x), (0.18, 0.31), 0.085) for x in (-0.85, -0.05)]
    chassis = box((-0.80, -0.21, 0.10), (-0.10, 0.21, 0.33))
    ring = rod("z", (-0.45, 0.0), (0.32, 0.37), 0.20)
    return join(both(join(track, *grouser, *wheels)), chassis, ring)


def carrier_turret() -> Trimesh:
    """Turret with the motor's cover, and the column that carries the beam."""
    body = trimesh.convex.convex_hull(
        [
            (x, y, z)
            for y in (-0.24, 0.24)
            for x, z in ((-0.92, 0.375), (-0.95, 0.60), (-0.80, 0.68))
        ]
        + [
            (x, y, z)
            for y in (-0.24, 0.24)
            for x, z in ((-0.40, 0.68), (-0.30, 0.52), (-0.30, 0.375))
        ]
    )
    slots = [
        box((-0.96, -0.16, 0.45 + 0.04 * k), (-0.90, 0.16, 0.47 + 0.04 * k))
        for k in range(4)
    ]
    column = trimesh.convex.convex_hull(
        [
            (x, y, z)
            for y in (-0.10, 0.10)
            for x, z in ((-0.36, 0.38), (-0.36, 0.56), (0.05, 0.60), (0.05, 0.52))
        ]
    )
    return join(cut(body, *slots), column)


def carrier_beam() -> Trimesh:
    """Beam across the column, with the seats of both arms."""
    cross = box((-0.07, -0.42, 0.58), (0.07, 0.42, 0.685))
    ends = both(plate("x", (-0.08, 0.08), (-0.41, 0.632, 0.03), (-0.43, 0.632, 0.03)))
    arm = join(*seat()).apply_translation((0.0, -0.32, 0.8))
    return join(cross, ends, both(arm))


def link1() -> Trimesh:
    """Slewing post: horn of the azimuth cylinder below, shoulder clevis in front."""
    ring = rod("z", (0.0, 0.0), (-0.056, -0.015), 0.060)
    horn = cut(
        plate("z", (-0.046, -0.024), (0.0, 0.0, 0.045), (0.0, -0.065, 0.020)),
        rod("z", (0.0, -0.065), (-0.1, 0.1), 0.009),
    )
    post = cut(
        rod("z", (0.0, 0.0), (-0.02, 0.135), 0.050),
        rod("z", (0.0, 0.0), (-0.03, 0.125), 0.036),
    )
    cheek = plate(
        "y",
        (0.038, 0.052),
        (0.08, 0.0, 0.045),
        (0.08, 0.105, 0.036),
        (0.001, 0.116, 0.022),
    )
    boss = rod("y", (0.08, 0.105), (0.050, 0.062), 0.026)
    stub = rod("y", (0.08, 0.105), (0.020, 0.066), 0.012)
    pin = rod("y", (0.0008, 0.1161), (-0.058, 0.058), 0.009)
    fork = cut(
        both(join(cheek, boss, stub)), rod("z", (0.0, 0.0), (-0.03, 0.125), 0.036)
    )
    return join(
        ring, horn, post, fork, pin, bolts("z", (0.133, 0.141), 0.036, 0.005, 6)
    )


def link2() -> Trimesh:
    """Upper arm: box beam, forked at the shoulder and at the elbow."""
    girder = beam((0.07, 0.37), 0.038, (-0.035, 0.035), 0.004)
    root = cut(
        plate("y", (0.022, 0.036), (0.0, 0.0, 0.034), (0.0, 0.11, 0.034)),
        rod("y", (0.0, 0.0), (0.0, 0.1), 0.012),
    )
    cheek = plate(
        "y", (0.037, 0.052), (0.0, 0.30, 0.030), (0.0, 0.38, 0.038), (0.0, 0.50, 0.036)
    )
    boss = rod("y", (0.0, 0.50), (0.050, 0.062), 0.026)
    stub = rod("y", (0.0, 0.50), (0.020, 0.066), 0.012)
    lug = cut(
        plate(
            "y",
            (0.020, 0.034),
            (-0.0624, 0.2934, 0.018),
            (-0.030, 0.27, 0.02),
            (-0.030, 0.32, 0.02),
        ),
        box((0.2, 0.0, -0.030), (0.4, 0.1, 0.1)),
    )
    pins = [
        rod("y", (-0.0624, 0.2934), (-0.040, 0.040), 0.009),
        rod("y", (-0.0056, 0.4202), (-0.057, 0.057), 0.009),
    ]
    hose = both(rod("x", (0.020, 0.043), (0.10, 0.33), 0.007))
    saddles = [
        box((x, -0.030, 0.034), (x + 0.012, 0.030, 0.042)) for x in (0.12, 0.21, 0.30)
    ]
    return join(girder, both(join(root, cheek, boss, stub, lug)), *pins, hose, *saddles)


def link3() -> Trimesh:
    """Forearm: forked root, box beam, and the housing of the roll actuator."""
    root = cut(
        plate("y", (0.022, 0.036), (0.0, 0.0, 0.034), (0.018, 0.11, 0.030)),
        rod("y", (0.0, 0.0), (0.0, 0.1), 0.012),
    )
    girder = beam((0.07, 0.29), 0.038, (-0.012, 0.048), 0.004)
    housing = cut(
        rod("x", (0.0, 0.0), (0.255, 0.385), 0.054),
        rod("x", (0.0, 0.0), (0.27, 0.40), 0.040),
    )
    flange = tube("x", (0.0, 0.0), (0.375, 0.397), 0.062, 0.040)
    collar = tube("x", (0.0, 0.0), (0.262, 0.280), 0.060, 0.050)
    lug = plate(
        "y",
        (0.020, 0.032),
        (-0.0827, 0.2884, 0.017),
        (-0.045, 0.275, 0.017),
        (-0.045, 0.315, 0.017),
    )
    lug = cut(lug, rod("x", (0.0, 0.0), (0.27, 0.40), 0.050))
    pin = rod("y", (-0.0827, 0.2884), (-0.038, 0.038), 0.009)
    ports = both(rod("z", (0.335, 0.025), (0.04, 0.066), 0.010))
    ports = cut(ports, rod("x", (0.0, 0.0), (0.27, 0.40), 0.040))
    girder = cut(girder, rod("x", (0.0, 0.0), (0.27, 0.40), 0.040))
    return join(
        girder,
        both(join(root, lug)),
        housing,
        flange,
        collar,
        pin,
        ports,
        bolts("x", (0.367, 0.377), 0.0575, 0.004, 8),
    )


def link4() -> Trimesh:
    """Roll output: flange, neck, wrist clevis, and the bracket of the wrist
    cylinder."""
    flange = rod("x", (0.0, 0.0), (-0.002, 0.014), 0.062)
    neck = cut(
        rod("x", (0.0, 0.0), (0.012, 0.085), 0.044),
        rod("x", (0.0, 0.0), (0.020, 0.075), 0.034),
    )
    cheek = plate("y", (0.028, 0.040), (0.0, 0.070, 0.034), (0.0, 0.15, 0.030))
    boss = rod("y", (0.0, 0.15), (0.038, 0.048), 0.021)
    stub = rod("y", (0.0, 0.15), (0.014, 0.052), 0.009)
    bracket = join(
        box((0.0, 0.014, -0.098), (0.016, 0.024, -0.03)),
        plate(
            "y", (0.014, 0.024), (-0.0845, -0.0312, 0.0135), (-0.0845, 0.002, 0.0135)
        ),
    )
    pin = rod("y", (-0.0846, -0.0312), (-0.028, 0.028), 0.007)
    return join(
        flange,
        neck,
        both(join(cheek, boss, stub, bracket)),
        pin,
        bolts("x", (0.012, 0.020), 0.053, 0.004, 8),
    )


def link5() -> Trimesh:
    """Wrist: eye and horn, and the housing of the jaw rotation motor."""
    ear = plate(
        "y",
        (0.012, 0.026),
        (0.0, 0.0, 0.026),
        (-0.039, 0.0182, 0.013),
        (0.0, 0.048, 0.030),
    )
    ear = cut(ear, rod("y", (0.0, 0.0), (0.0, 0.1), 0.009))
    housing = cut(
        rod("x", (0.0, 0.0), (0.042, 0.112), 0.042),
        rod("x", (0.0, 0.0), (0.052, 0.13), 0.030),
    )
    flange = tube("x", (0.0, 0.0), (0.100, 0.118), 0.050, 0.030)
    pin = rod("y", (-0.0390, 0.0182), (-0.030, 0.030), 0.007)
    ports = cut(
        both(rod("z", (0.078, 0.018), (0.03, 0.052), 0.008)),
        rod("x", (0.0, 0.0), (0.052, 0.13), 0.030),
    )
    return join(
        both(ear),
        housing,
        flange,
        pin,
        ports,
        bolts("x", (0.093, 0.102), 0.046, 0.003, 8),
    )


def link6() -> Trimesh:
    """Gripper body: flange, neck and two plates that hold the jaws' pin and the
    gripper's cylinder."""
    flange = rod("x", (0.0, 0.0), (0.0, 0.014), 0.050)
    neck = tube("x", (0.0, 0.0), (0.010, 0.050), 0.034, 0.022)
    cheek = plate(
        "z",
        (0.022, 0.032),
        (0.018, 0.062, 0.014),
        (0.018, -0.062, 0.014),
        (0.15, 0.0, 0.026),
    )
    cheek = cut(
        cheek,
        rod("z", (0.098, 0.0), (0.0, 0.1), 0.016),
        plate("z", (0.0, 0.1), (0.045, 0.035, 0.009), (0.075, 0.023, 0.007)),
        plate("z", (0.0, 0.1), (0.045, -0.035, 0.009), (0.075, -0.023, 0.007)),
    )
    spacer = both(rod("z", (0.0142, 0.0635), (-0.04, 0.04), 0.007))
    pin = rod("z", (0.15, 0.0), (-0.039, 0.039), 0.010)
    return join(
        flange,
        neck,
        both(cheek, axis=2),
        spacer,
        pin,
        bolts("x", (0.012, 0.019), 0.043, 0.003, 8),
    )


def finger() -> Trimesh:
    """A jaw's finger on the side of positive y, its toothed face in the plane y = 0."""
    bow = join(
        plate("z", (-0.021, 0.021), (0.075, 0.030, 0.012), (0.118, 0.026, 0.014)),
        plate("z", (-0.021, 0.021), (0.118, 0.026, 0.014), (0.175, 0.008, 0.007)),
        box((0.100, 0.0005, -0.021), (0.176, 0.012, 0.021)),
    )
    teeth = [
        box((-0.0035, -0.0035, -0.03), (0.0035, 0.0035, 0.03))
        .apply_transform(
            trimesh.transformations.rotation_matrix(math.pi / 4, (0, 0, 1))
        )
        .apply_translation((x, 0.0005, 0.0))
        for x in np.arange(0.107, 0.175, 0.0098)
    ]
    return cut(bow, *teeth)


def jaw_left() -> Trimesh:
    """Moving jaw: finger, hub, and the horn of the gripper's cylinder."""
    arm = join(
        plate("z", (-0.009, 0.009), (0.0, 0.0, 0.022), (0.045, 0.030, 0.013)),
        plate("z", (-0.009, 0.009), (0.045, 0.030, 0.013), (0.085, 0.031, 0.012)),
        plate("z", (-0.008, 0.008), (0.0, 0.0, 0.018), (-0.0052, -0.0598, 0.012)),
    )
    return cut(
        join(arm, finger()),
        rod("z", (0.0, 0.0), (-0.1, 0.1), 0.010),
        rod("z", (-0.0052, -0.0598), (-0.1, 0.1), 0.005),
    )


def jaw_right() -> Trimesh:
    """Fixed jaw: a fork around the moving one, and the mirrored finger."""
    mirror = np.diag([1.0, -1.0, 1.0, 1.0])
    tine = join(
        plate("z", (0.0105, 0.021), (0.0, 0.0, 0.022), (0.045, -0.030, 0.013)),
        plate("z", (0.0105, 0.021), (0.045, -0.030, 0.013), (0.085, -0.031, 0.012)),
    )
    tip = finger().apply_transform(mirror)
    tip = cut(tip, box((0.0, -0.1, -0.0105), (0.088, 0.1, 0.0105)))
    return cut(join(both(tine, axis=2), tip), rod("z", (0.0, 0.0), (-0.1, 0.1), 0.010))


PARTS: tuple[Callable[[], Trimesh], ...] = (
    base,
    link1,
    link2,
    link3,
    link4,
    link5,
    link6,
    jaw_left,
    jaw_right,
    carrier_tracks,
    carrier_turret,
    carrier_beam,
)


def main(folder: Path) -> None:
    """Write every part to `folder`."""
    for part in PARTS:
        solid = canonical(part())
        if not solid.is_watertight or solid.volume <= 0:
            raise SystemExit(f"{part.__name__} is not watertight")
        data = solid.export(file_type="stl")
        (folder / f"{part.__name__}.stl").write_bytes(data)
        size, volume = len(data) / 1000, 1e6 * solid.volume
        print(
            f"{part.__name__:10} {len(solid.faces):5} faces  {size:5.1f} kB  {volume:7.1f} cm³"
        )


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent)
