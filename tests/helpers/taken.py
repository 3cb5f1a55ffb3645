"""Files of runs without the times that the runs took: no two take the same."""

import re

_TAKEN = re.compile(rb"(took|search|refinement|uncertainty) \d[\d.]* (s|min|h)\b")


def without_times(data: bytes) -> bytes:
    """Return a page without the times that a fit and its steps took."""
    return _TAKEN.sub(rb"\1", data)
