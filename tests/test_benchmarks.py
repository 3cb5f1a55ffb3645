"""Every benchmark can be imported from its own folder, as `make` runs it."""

import subprocess
import sys
from pathlib import Path

BENCHMARKS = Path(__file__).parents[1] / "benchmarks"


def test_every_benchmark_can_be_imported():
    names = sorted({file.stem for file in BENCHMARKS.glob("*.py")})
    assert names
    program = f"import importlib\nfor name in {names}: importlib.import_module(name)"
    subprocess.run([sys.executable, "-c", program], cwd=BENCHMARKS, check=True)
