"""Arms as CAD and simulators have them are taken rightly by `init`, or a line says what
was done."""

from pathlib import Path

import pytest
from field_arms import FIELD_ARMS, FieldArm, outcome

pytestmark = pytest.mark.usefixtures("no_picture", "short_searches")


@pytest.mark.parametrize("arm", FIELD_ARMS, ids=lambda arm: arm.name)
def test_an_arm_is_taken_rightly_or_its_fault_is_said(
    arm: FieldArm, tmp_path: Path
) -> None:
    found = outcome(arm, tmp_path)
    assert found.verdict == ("said" if arm.said else "right"), found.line
