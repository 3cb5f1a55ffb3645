from hypothesis import given
from hypothesis import strategies as st

from hydroid.settings.log import ColumnMap, LogSettings

names = st.text("abcxyz_ []°", min_size=1, max_size=6)
scales = st.floats(0.1, 10)
command = st.fixed_dictionaries(
    {},
    optional={"column": names | st.lists(names, min_size=2, max_size=2), "scale": scales, "offset": scales},
)
angle = st.fixed_dictionaries(
    {}, optional={"column": names, "unit": st.sampled_from(["deg", "rad"]), "scale": scales}
)
joint = st.none() | st.fixed_dictionaries(
    {}, optional={"command": st.none() | command, "angle": st.none() | angle}
)


@given(st.dictionaries(st.integers(1, 9), joint), st.none() | scales, st.booleans())
def test_dumped_settings_read_back_as_the_same(joints: dict, scale: float | None, unmapped: bool) -> None:
    values: dict = {"joints": joints, "command": None if unmapped else {}}
    if scale and not unmapped:
        values["command"] = {"column": "c{joint}", "scale": scale}
    settings = LogSettings.model_validate(values)
    assert LogSettings.model_validate(settings.model_dump()) == settings
    assert LogSettings.model_validate(settings.model_dump(mode="json")) == settings


def test_a_joint_inherits_what_it_does_not_say() -> None:
    settings = LogSettings.model_validate(
        {
            "command": {"column": ["up{joint}", "down{joint}"], "scale": 10},
            "angle": {"unit": "rad"},
            "joints": {2: {"command": {"offset": 1}}, 3: {"angle": {"column": "elbow"}}, 4: None},
        }
    )
    assert settings.columns("command", 1) == ColumnMap(("up1", "down1"), "%", scale=10)
    assert settings.columns("command", 2) == ColumnMap(("up2", "down2"), "%", scale=10, offset=1)
    assert settings.columns("angle", 3) == ColumnMap(("elbow",), "rad")
    assert settings.columns("command", 4) is None
    assert settings.columns("angle", 4) is None
