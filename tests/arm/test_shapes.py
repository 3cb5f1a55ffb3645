import subprocess
import sys

import numpy as np
import pytest

from hydroid.arm.mesh import mass_properties
from hydroid.assets import assets

FOLDER = assets() / "meshes"
pytestmark = pytest.mark.slow  # manifold3d cuts all meshes twice


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    pytest.importorskip("manifold3d")
    folders = [tmp_path_factory.mktemp(name) for name in ("once", "again")]
    for folder in folders:
        subprocess.run([sys.executable, FOLDER / "make_meshes.py", folder], check=True, capture_output=True)
    return folders


def test_making_the_meshes_twice_gives_the_same_bytes(made):
    once, again = made
    for path in once.glob("*.stl"):
        assert path.read_bytes() == (again / path.name).read_bytes()


def test_the_committed_meshes_are_those_of_the_script(made):
    committed = sorted(FOLDER.glob("*.stl"))
    assert [p.name for p in committed] == sorted(p.name for p in made[0].glob("*.stl"))
    for path in committed:  # another release of manifold3d may cut other triangles from the same solid
        kept, fresh = mass_properties(path), mass_properties(made[0] / path.name)
        assert fresh.volume == pytest.approx(kept.volume, rel=1e-5)
        np.testing.assert_allclose(fresh.centre, kept.centre, atol=1e-5)
        np.testing.assert_allclose(fresh.inertia, kept.inertia, rtol=1e-4, atol=1e-7)
