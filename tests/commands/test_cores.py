"""No bit of what the command line prints depends on the number of cores."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
import yaml
from log_files import head
from made_logs import TRUTH


@pytest.mark.skipif((os.cpu_count() or 1) < 2, reason="has one core")
@pytest.mark.skipif(
    not hasattr(os, "sched_setaffinity"), reason="cores cannot be chosen"
)
def test_uncertainties_are_the_same_on_one_core_and_on_all(tmp_path: Path):
    (tmp_path / "values.yaml").write_text(yaml.safe_dump(TRUTH))
    head(tmp_path / "a.csv", 1000)
    words = ["analyse", "a.csv", "--fit", "values.yaml", "--json"]
    code = f"import os, sys; {{}}; sys.argv[1:] = {words!r}; from hydroid.__main__ import main; main()"
    environment = {
        key: value for key, value in os.environ.items() if not key.endswith("_THREADS")
    }
    printed = [
        subprocess.run(
            [sys.executable, "-c", code.format(cores)],
            cwd=tmp_path,
            env=environment,
            capture_output=True,
            check=True,
        ).stdout
        for cores in ("os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})", "pass")
    ]
    assert printed[0] == printed[1]
