"""A wrong setting or a broken log is answered at once: reading them imports nothing heavy."""

import subprocess
import sys

import pytest

HEAVY = ["mujoco", "numba", "scipy", "matplotlib", "trimesh", "jinja2", "rich", "distributed", "pymoo", "cma"]


@pytest.mark.parametrize(
    "package", ["hydroid.settings.fit", "hydroid.settings.load", "hydroid.log", "hydroid.parameters"]
)
def test_settings_and_logs_import_nothing_heavy(package: str):
    code = f"import sys, {package}; print([m for m in {HEAVY} if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
