"""Messages for faults that pydantic finds in settings."""

import difflib
from typing import Any

from pydantic import BaseModel

LONGEST = 60
"""characters of a value in a message"""

RENAMED = {
    "polish": "refinement",
    "refine": "joint_refinement",
    "known": "priors",
    "step_tolerance": "gain_tolerance",
}
"""settings of earlier versions, and what they are called now"""

_PLAIN = {
    "bool": "must be true or false",
    "dict": "must be a mapping of settings",
    "finite_number": "must be a finite number",
    "float": "must be a number",
    "int": "must be a whole number",
    "list": "must be a list in brackets, [a, b]",
    "model": "must be a mapping of settings",
    "string_type": "must be text",
    "tuple": "must be a list in brackets, [a, b]",
}
_COMPARED = {"greater_than": "above", "greater_than_equal": "at least", "less_than": "below"}
_COMPARED["less_than_equal"] = "at most"


def explain(key: str, fault: Any, kind: type[BaseModel]) -> str:
    """Return what is wrong with the setting `key`, a clause.

    Args:
        key: dotted; empty where the settings as a whole are at fault.
        fault: one of pydantic's `ValidationError.errors()`.
        kind: the settings class that was asked for.
    """
    if fault["type"] == "extra_forbidden":
        name = str(fault["loc"][-1])
        if new := RENAMED.get(name):
            return f"unknown setting {shown(key)}; it is now called {new!r}"
        allowed = _allowed(kind, fault["loc"][:-1])
        near = difflib.get_close_matches(name, allowed, n=1)
        choice = f"did you mean {near[0]!r}?" if near else f"allowed here: {', '.join(allowed)}"
        return f"unknown setting {shown(key)}" + (f"; {choice}" if allowed else "")
    if fault["type"] == "missing":
        return f"setting {key!r} is missing"
    problem = f"{shown(key)[1:-1]}: {_problem(fault)}" if key else _problem(fault)
    return problem if isinstance(fault["input"], dict) else f"{problem} (given: {shown(fault['input'])})"


def shown(value: object) -> str:
    """Return a value as YAML writes it, shortened where it is long."""
    words = {True: "true", False: "false"} if isinstance(value, bool) else {None: "null"}
    text = words[value] if value is None or isinstance(value, bool) else repr(value)
    if isinstance(value, tuple):
        text = f"[{', '.join(map(shown, value))}]"
    return text if len(text) <= LONGEST else f"{text[: LONGEST - 4]}...{text[-1]}"


def _problem(fault: Any) -> str:
    name, context = fault["type"], fault.get("ctx", {})
    if name in _COMPARED:
        return f"must be {_COMPARED[name]} {next(iter(context.values())):g}"
    if name == "literal_error":
        return f"must be {context['expected']}"
    if name == "too_long":
        return f"must have at most {context['max_length']} items"
    if name == "too_short":
        return f"must have at least {context['min_length']} items"
    for start, words in _PLAIN.items():
        if name.startswith(start):
            return words
    message = str(fault["msg"]).removeprefix("Value error, ")
    return message[:1].lower() + message[1:]


def _allowed(kind: type[BaseModel], loc: tuple[Any, ...]) -> list[str]:
    """Names of the settings at `loc`, if the path can be followed through nested classes."""
    for part in loc:
        field = kind.model_fields.get(str(part))
        inner = field.annotation if field else None
        if not (isinstance(inner, type) and issubclass(inner, BaseModel)):
            return []
        kind = inner
    return list(kind.model_fields)
