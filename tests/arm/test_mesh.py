import math

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from hydroid.arm.mesh import mass_properties
from hydroid.assets import assets
from hydroid.errors import MeshError

MESHES = sorted((assets() / "meshes").glob("*.stl"))


def save(mesh, path):
    path.write_bytes(mesh.export(file_type="stl"))
    return path


def by_tetrahedra(path):
    """Volume, centre and inertia per kg from signed tetrahedra with the origin."""
    corners = trimesh.load_mesh(path).triangles.view(np.ndarray).astype(float)
    volumes = np.linalg.det(corners) / 6
    volume = volumes.sum()
    sums = corners.sum(axis=1)
    centre = (volumes[:, None] * sums).sum(axis=0) / 4 / volume
    # over a tetrahedron with one corner at 0: integral of x xᵀ = V/20 (Σ vᵢ vᵢᵀ + s sᵀ), s = Σ vᵢ
    second = np.einsum("t,tki,tkj->ij", volumes, corners, corners)
    second += np.einsum("t,ti,tj->ij", volumes, sums, sums)
    second = second / 20 / volume - np.outer(centre, centre)
    return volume, centre, np.trace(second) * np.eye(3) - second


@pytest.mark.parametrize("path", MESHES, ids=lambda path: path.stem)
def test_shipped_meshes_agree_with_a_sum_over_tetrahedra(path):
    volume, centre, inertia = by_tetrahedra(path)
    found = mass_properties(path)
    assert found.volume == pytest.approx(volume, rel=1e-6)
    np.testing.assert_allclose(found.centre, centre, atol=1e-9)
    np.testing.assert_allclose(found.inertia, inertia, atol=1e-6 * np.abs(inertia).max())


def test_there_is_one_small_mesh_a_part():
    names = {"base", *(f"link{k}" for k in range(1, 7)), "jaw_left", "jaw_right"}
    names |= {"carrier_tracks", "carrier_turret", "carrier_beam"}
    assert {path.stem for path in MESHES} == names
    assert all(path.stat().st_size < 100_000 for path in MESHES)


@settings(max_examples=25, deadline=None)
@given(
    size=st.tuples(*[st.floats(0.02, 1.0)] * 3),
    at=st.tuples(*[st.floats(-1.0, 1.0)] * 3),
    turn=st.tuples(*[st.floats(-3.0, 3.0)] * 3),
)
def test_a_box_anywhere_and_any_way_up_has_the_inertia_of_the_formula(tmp_path_factory, size, at, turn):
    rotation = Rotation.from_rotvec(turn).as_matrix()
    placed = np.eye(4)
    placed[:3, :3], placed[:3, 3] = rotation, at
    box = trimesh.creation.box(extents=size, transform=placed)
    found = mass_properties(save(box, tmp_path_factory.getbasetemp() / "box.stl"))
    square = np.square(size)
    expected = rotation @ np.diag((square.sum() - square) / 12) @ rotation.T
    assert found.volume == pytest.approx(np.prod(size), rel=1e-5)  # STL holds single precision
    np.testing.assert_allclose(found.centre, at, atol=1e-6)
    np.testing.assert_allclose(found.inertia, expected, atol=1e-5 * expected.max())


def test_a_tube_has_the_inertia_of_two_prisms(tmp_path):
    outer, inner, height, sides = 0.125, 0.0625, 0.5, 32
    mesh = trimesh.creation.annulus(r_min=inner, r_max=outer, height=height, sections=sides)
    found = mass_properties(save(mesh, tmp_path / "tube.stl"))

    def prism(radius):
        """Area of a regular polygon, and its second moment about a diameter."""
        area = 0.5 * sides * radius**2 * math.sin(2 * math.pi / sides)
        side = 2 * radius * math.sin(math.pi / sides)
        return np.array([area, area / 24 * (6 * radius**2 - side**2)])

    area, second = prism(outer) - prism(inner)
    across = second / area + height**2 / 12
    assert found.volume == pytest.approx(area * height, rel=1e-6)
    np.testing.assert_allclose(np.diag(found.inertia), [across, across, 2 * second / area], rtol=1e-6)


def sound():
    return trimesh.creation.icosphere(subdivisions=2, radius=0.1)


def opened():
    mesh = sound()
    mesh.update_faces(np.arange(len(mesh.faces)) > 3)
    return mesh


def inverted():
    mesh = sound()
    mesh.invert()
    return mesh


def one_face_flipped():
    mesh = sound()
    faces = mesh.faces.copy()
    faces[7] = faces[7][::-1]
    return trimesh.Trimesh(mesh.vertices, faces, process=False)


def flat():
    mesh = sound()
    return trimesh.Trimesh(mesh.vertices * [1, 1, 0], mesh.faces, process=False)


def undefined():
    mesh = sound()
    vertices = mesh.vertices.copy()
    vertices[5] = np.nan
    return trimesh.Trimesh(vertices, mesh.faces, process=False, validate=False)


@pytest.mark.parametrize(
    ("mesh", "message"),
    [
        (opened, "not watertight.*close its holes"),
        (inverted, "inside out.*flip its normals"),
        (one_face_flipped, "inward and outward"),
        (flat, "encloses no volume|not watertight"),
        (undefined, "not finite"),
        (lambda: sound().apply_scale(1000), "200 m long, which looks like millimetres.*0.001"),
    ],
)
def test_a_mesh_without_meaning_is_refused_by_name_with_a_cure(tmp_path, mesh, message):
    path = save(mesh(), tmp_path / "link2.stl")
    with pytest.raises(MeshError, match=f"link2.stl: .*{message}"):
        mass_properties(path)


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (b"", "it has 0 bytes, its head alone is 84"),
        (b"not a mesh at all", "it has 17 bytes"),
        (b"solid x\nendsolid x\n", "is an ASCII STL; export it again, as binary STL"),
        (b"\0" * 80 + b"\xff\xff\xff\x7f", "it has 84 bytes, and 2147483647 faces would need 107374182434"),
        (b"\0" * 84, "holds no triangles"),
    ],
)
def test_a_file_without_a_mesh_is_one_clear_line(tmp_path, content, says):
    path = tmp_path / "link2.stl"
    path.write_bytes(content)
    with pytest.raises(MeshError, match=rf"link2.stl: .*{says}") as caught:
        mass_properties(path)
    assert "\n" not in str(caught.value)


def test_a_mesh_far_from_its_joint_is_refused(tmp_path):
    with pytest.raises(MeshError, match="lies 100 m from its origin"):
        mass_properties(save(sound().apply_translation([0, 0, 100]), tmp_path / "link2.stl"))


def test_a_missing_mesh_is_named(tmp_path):
    with pytest.raises(MeshError, match=r"link9\.stl: no such mesh; put"):
        mass_properties(tmp_path / "link9.stl")
