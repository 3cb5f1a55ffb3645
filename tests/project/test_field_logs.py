"""Logs as machines record them are read rightly by what `init` writes, or a line says
what is wrong."""

from pathlib import Path

import pytest
from field_logs import FIELD_LOGS, FieldLog, outcome

import hydroid
from hydroid.settings.arm import Arm, load_arm


@pytest.fixture(scope="module")
def arm(tmp_path_factory: pytest.TempPathFactory) -> Arm:
    """The template's."""
    home = tmp_path_factory.mktemp("template")
    hydroid.init(home / "mine")
    return load_arm(home / "mine" / "arm.yaml")


@pytest.mark.parametrize("log", FIELD_LOGS, ids=lambda log: log.name)
def test_a_log_is_read_rightly_or_its_fault_is_said(
    log: FieldLog, arm: Arm, tmp_path: Path
) -> None:
    found = outcome(log, tmp_path, arm)
    assert found.verdict == ("said" if log.said else "right"), found.line
