import pytest


@pytest.fixture
def no_picture(monkeypatch: pytest.MonkeyPatch) -> None:
    """The picture of an arm takes `init` half of its time."""
    monkeypatch.setattr("hydroid.project.project.arm_picture", lambda *_: b"")
