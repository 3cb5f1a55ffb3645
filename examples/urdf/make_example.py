"""Make what one gets from CAD and from a logger, for an arm of ours: robot.urdf, its
meshes, and three logs.

    python examples/urdf/make_example.py

NO MACHINE: the arm is made of blocks, and the logs are simulated by hydroid itself at
values that the fit is not told. They show the way from CAD to a validated fit, not how
well hydroid describes a real arm.
"""

import sys
import tempfile
from pathlib import Path

import numpy as np
import trimesh

import hydroid
from hydroid.identified_model import IdentifiedModel, identified
from hydroid.log import Log

SIZES = {
    "swing": (0.6, 0.5, 0.4),
    "boom": (1.8, 0.15, 0.25),
    "stick": (1.4, 0.12, 0.18),
}
"""length, width and height of the blocks [m]; each begins at its joint"""
MASSES = {"swing": 300.0, "boom": 120.0, "stick": 60.0}
JOINTS = {  # parent, place [m], turn [rad], axis, range [rad]
    "swing": ("base", "0 0 0.6", "0 0 0", "0 0 1", (-2.8, 2.8)),
    "boom": ("swing", "0.3 0 0.2", "1.5708 0 0", "0 0 -1", (-0.6, 1.2)),
    "stick": ("boom", "1.8 0 0", "0 0 0", "0 0 -1", (-2.8, 0.4)),
}
TRUTH = {
    "open_A": 1.3,
    "open_B": 0.8,
    "dead_A": 2.0,
    "dead_B": 3.0,
    "lag": 2.0,
    "size": 1.2,
    "D": 0.7,
    "slow": 0.0,
    "P_flow": 30.0,
    "P_power": 1.0 / 1.2,
    "P_past": 0.0,
}
"""factors between the machine's values and those of a project, by the beginning of
their names"""
PERIOD, SECONDS, NOISE_DEG = 0.02, 16.0, 0.05


def urdf() -> str:
    """The robot, as an exporter would write it; the frames of boom and stick are
    turned."""
    parts = ['<robot name="demo_arm">', '  <link name="base"/>']
    for name, (length, width, height) in SIZES.items():
        m, turned = MASSES[name], name != "swing"
        y, z = (height, width) if turned else (width, height)
        i = [
            m * (y * y + z * z) / 12,
            m * (length**2 + z * z) / 12,
            m * (length**2 + y * y) / 12,
        ]
        parts += [
            f'  <link name="{name}">',
            f'    <inertial><origin xyz="{length / 2} 0 0"/><mass value="{m}"/>',
            f'      <inertia ixx="{i[0]:.6g}" iyy="{i[1]:.6g}" izz="{i[2]:.6g}"',
            '       ixy="0" ixz="0" iyz="0"/></inertial>',
            f'    <visual><geometry><mesh filename="package://demo_arm/meshes/{name}.stl"/></geometry></visual>',
            "  </link>",
        ]
    for name, (parent, at, turn, axis, limits) in JOINTS.items():
        parts += [
            f'  <joint name="{name}_joint" type="revolute">',
            f'    <parent link="{parent}"/><child link="{name}"/>',
            f'    <origin xyz="{at}" rpy="{turn}"/><axis xyz="{axis}"/>',
            f'    <limit lower="{limits[0]}" upper="{limits[1]}" effort="1e5" velocity="1"/>',
            "  </joint>",
        ]
    return "\n".join([*parts, "</robot>", ""])


def mesh(name: str) -> bytes:
    """One block as binary STL, in its link's frame."""
    length, width, height = SIZES[name]
    solid = trimesh.creation.box(
        extents=(length, height, width) if name != "swing" else SIZES[name]
    )
    solid.apply_translation((length / 2, 0, 0))
    content = solid.export(file_type="stl")
    assert isinstance(content, bytes)
    return content


def commands(joints: int, seed: int) -> np.ndarray:
    """Steps of commands [%] between rests, shape (T, joints)."""
    rng, samples = np.random.default_rng(seed), round(SECONDS / PERIOD) + 1
    command = np.zeros((samples, joints))
    for joint in range(joints):
        at, sign = round(rng.uniform(1.0, 2.0) / PERIOD), 1.0 - 2.0 * (joint % 2)
        while at < samples:
            length = round(rng.uniform(0.4, 0.9) / PERIOD)
            command[at : at + length, joint] = sign * rng.uniform(25, 95)
            at, sign = at + length + round(rng.uniform(0.3, 1.0) / PERIOD), -sign
    return command


def machine(project: Path, **changes: object) -> IdentifiedModel:
    """The project's arm at other values."""
    model = hydroid.start_values(
        hydroid.load_settings(project / "fit.yaml", {"log.period_s": PERIOD} | changes)
    )
    factor = {
        n: next((f for s, f in TRUTH.items() if n.startswith(s)), 1.0)
        for n in model.values
    }
    return identified(
        model.settings,
        {n: v * factor[n] for n, v in model.values.items()},
        "the machine",
    )


def recorded(truth: IdentifiedModel, seed: int) -> Log:
    """Simulate commands to a machine."""
    arm = truth.settings.arm
    command = commands(len(arm.joints), seed)
    angle = np.tile(0.5 * (arm.lower + arm.upper), (len(command), 1))
    log = Log(
        "commands",
        np.arange(len(command), dtype=np.float64) * PERIOD,
        command,
        angle,
        PERIOD,
    )
    return hydroid.simulate(
        log, fit=truth, out=None, noise_deg=NOISE_DEG, seed=seed
    ).log


def write_log(project: Path, path: Path, seed: int) -> None:
    """Write what a logger of the machine would: volts and radians."""
    # a machine has oil and inertia
    truth = machine(project, **{"simulation.model": "dynamic"})
    log = recorded(truth, seed)
    names = [name.removesuffix("_joint") for name in truth.settings.arm.joint_names]
    what = ("valve [V]", "angle [rad]")
    header = ["Time [ms]", *(f"{name} {column}" for column in what for name in names)]
    # the boom's valve is wired the other way round
    rows = np.column_stack([1e3 * log.time, log.command / 10 * [1, -1, 1], log.angle])
    np.savetxt(
        path, rows, fmt="%.6g", delimiter=",", header=",".join(header), comments=""
    )


def main(folder: Path) -> None:
    """Write everything to a folder."""
    (folder / "meshes").mkdir(parents=True, exist_ok=True)
    for name in SIZES:
        (folder / "meshes" / f"{name}.stl").write_bytes(mesh(name))
    (folder / "robot.urdf").write_text(urdf(), encoding="utf-8")
    with tempfile.TemporaryDirectory() as place:
        project = Path(place) / "machine"
        hydroid.init(project, arm=folder / "robot.urdf")
        for number in (1, 2, 3):
            write_log(project, folder / f"log_{number}.csv", number)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent)
