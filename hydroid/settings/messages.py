"""Messages for faults that pydantic finds in settings."""

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
        key: dotted.
        fault: one of pydantic's `ValidationError.errors()`.
        kind: the settings class that was asked for.
    """
    if fault["type"] == "extra_forbidden":
        if new := RENAMED.get(str(fault["loc"][-1])):
            return f"unknown setting {shown(key)}; it is now called {new!r}"
        allowed = _allowed(kind, fault["loc"][:-1])
        return f"unknown setting {shown(key)}" + (f"; allowed here: {allowed}" if allowed else "")
    if fault["type"] == "missing":
        return f"setting {key!r} is missing"
    return f"{shown(key)[1:-1] or 'settings'}: {_problem(fault)} (given: {shown(fault['input'])})"


def shown(value: object) -> str:
    """Return a value as Python writes it, cut where it is long."""
    text = repr(value)
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


def _allowed(kind: type[BaseModel], loc: tuple[Any, ...]) -> str:
    """Names of the settings at `loc`, if the path can be followed through nested classes."""
    for part in loc:
        field = kind.model_fields.get(str(part))
        inner = field.annotation if field else None
        if not (isinstance(inner, type) and issubclass(inner, BaseModel)):
            return ""
        kind = inner
    return ", ".join(kind.model_fields)
