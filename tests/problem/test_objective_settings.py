import pytest

from hydroid.errors import SettingsError
from hydroid.settings.load import validate
from hydroid.settings.problem import ObjectiveSettings


def read(**values):
    return validate(values, ObjectiveSettings, "fit.yaml")


def test_the_defaults_are_the_articles():
    settings = read()
    assert (settings.norm, settings.relative, settings.segments.equal) == ("inf", False, 8)


@pytest.mark.parametrize("value", [1, 2, "inf", float("inf")])
def test_norms_as_yaml_writes_them(value):
    assert float(read(norm=value).norm) == float(value)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"norm": 3}, "norm"),
        ({"segments": {}}, "exactly one of equal, turning_points, times"),
        ({"segments": {"equal": 2, "times": [1.0]}}, "not equal and times"),
        ({"segments": {"times": [2.0, 1.0]}}, "must increase"),
        ({"segments": {"equal": 0}}, "segments.equal"),
        ({"segments": {"times": [0.0]}}, "segments.times.0"),
        ({"segments": {"pieces": 8}}, "unknown setting"),
    ],
)
def test_what_is_refused_is_named(values, message):
    with pytest.raises(SettingsError, match=message):
        read(**values)
