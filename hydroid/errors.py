"""What the user can mend: each error says what is wrong, where, and what is allowed or to be done.

Every class here ends a command with one line and exit status 2. Anything else that escapes is a
defect of hydroid and keeps its traceback.
"""

LONGEST = 1500
"""characters of a message"""


class HydroidError(Exception):
    """A fault the user can mend.

    Args:
        what: what is wrong, a clause without a full stop.
        where: the file, with line, column or setting where known.
        hint: what is allowed, or what to do.
    """

    def __init__(self, what: str, *, where: str = "", hint: str = "") -> None:
        self.what, self.where, self.hint = what, where, hint
        text = f"{where}: {what}" if where else what
        super().__init__(_one_line(f"{text}; {hint}" if hint else text))

    def __reduce__(self) -> tuple[object, ...]:
        """Keep the three parts when an error crosses a process boundary."""
        return _rebuild, (type(self), self.what, self.where, self.hint)


def _one_line(text: str) -> str:
    """What a file holds stands in messages: escape what a terminal would obey, and cut what nobody reads."""
    plain = "".join(c if c.isprintable() else ascii(c)[1:-1] for c in text)
    return plain if len(plain) <= LONGEST else f"{plain[: LONGEST // 2]} ... {plain[-LONGEST // 2 :]}"


def _rebuild(kind: type[HydroidError], what: str, where: str, hint: str) -> HydroidError:
    return kind(what, where=where, hint=hint)


class LogError(HydroidError):
    """A CSV log that cannot be used as it is."""


class SettingsError(HydroidError):
    """A YAML file or a --set that asks for something that does not exist or is not allowed."""


class MeshError(HydroidError):
    """A mesh from which no mass properties can be computed."""


class ModelError(HydroidError):
    """An MJCF model that does not fit the arm's settings."""


class RunError(HydroidError):
    """A run folder that cannot be written, continued or read."""
