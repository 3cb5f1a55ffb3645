"""Short, safe and distinct names for logs, fits and files, whatever the user's files are called."""

import re
from collections.abc import Collection, Sequence
from itertools import count
from pathlib import Path

_LONGEST = 40


def log_names(sources: Sequence[str]) -> list[str]:
    """Return short names of log files, all different."""
    names: list[str] = []
    for source in sources:
        names.append(unique(short_name(Path(source).name or source), names))
    return names


def unique(name: str, taken: Collection[str]) -> str:
    """Return the name, numbered where it is taken."""
    candidates = (f"{name} ({n})" if n > 1 else name for n in count(1))
    return next(candidate for candidate in candidates if candidate not in taken)


def file_name(text: str, taken: set[str]) -> str:
    """Return a name of letters, digits, dot, dash and underscore, and add it to `taken`.

    It is numbered where a name that differs only in case is taken.
    """
    safe = re.sub(r"[^A-Za-z0-9._-]+", "_", text)
    candidates = (f"{safe}_{n}" if n > 1 else safe for n in count(1))
    name = next(candidate for candidate in candidates if candidate.lower() not in taken)
    taken.add(name.lower())
    return name


def short_name(name: str) -> str:
    """Return a name with unprintable characters replaced and the middle of a long one left out."""
    text = "".join(c if c.isprintable() else "?" for c in name)
    half = _LONGEST // 2
    return text if len(text) <= _LONGEST else f"{text[: half - 1]}…{text[-half:]}"
