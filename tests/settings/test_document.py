"""The reader of YAML, with libyaml and without it."""

import pytest
import yaml

from hydroid.errors import SettingsError
from hydroid.settings.document import read_document

TEXTS = [
    "a: 010\nb: '010'\nc: [1e3, .inf, null, true]\n",
    'd: {e: ~, f: "~"}\n# a comment\ng: |\n  two\n  lines\n',
    "a: &x [1, 2]\nb: *x\n",
]
WRONG = ["a: b: c", "\ta: 1", "a: [1,2\nb: 3", "a: 1\n---\nb: 2", "[" * 5000]


@pytest.mark.parametrize("text", TEXTS)
def test_both_readers_find_the_same(text, monkeypatch):
    found = read_document(text, "a file")
    monkeypatch.delattr(yaml, "CBaseLoader", raising=False)
    assert read_document(text, "a file") == found


@pytest.mark.parametrize("text", WRONG)
def test_both_readers_say_the_same_of_what_is_wrong(text, monkeypatch):
    with pytest.raises(SettingsError) as fast:
        read_document(text, "a file")
    monkeypatch.delattr(yaml, "CBaseLoader", raising=False)
    with pytest.raises(SettingsError) as slow:
        read_document(text, "a file")
    assert str(fast.value) == str(slow.value)
