"""Errors that a user can correct: each says what is wrong, where,
and what is allowed or what to do.

The command line shows them as one line and ends with exit status 2. Any other exception
is a defect of hydroid and keeps its traceback.
"""

LONGEST = 1500  # characters of a message, at most


class HydroidError(Exception):
    """An error that the user can correct.

    Args:
        what: what is wrong, a clause without a full stop.
        where: the file, with line, column or setting where known.
        hint: what is allowed, or what to do.
    """

    def __init__(self, what: str, where: object = "", hint: str = "") -> None:
        self.what = what
        self.where = str(where)
        self.hint = hint
        text = what
        if self.where:
            text = f"{where}: {text}"
        if hint:
            text = f"{text}; {hint}"
        # first of what is huge, then of what became long by its control characters
        super().__init__(_shortened(_visible(_shortened(text))))

    def __reduce__(self) -> tuple[object, ...]:
        """Keep the three parts when an error crosses a process boundary."""
        return type(self), (self.what, self.where, self.hint)


def _visible(text: str) -> str:
    """Return a text with its control characters spelt out: they may come from a
    file."""
    return "".join(c if c.isprintable() else ascii(c)[1:-1] for c in text)


def _shortened(text: str) -> str:
    """Return the beginning and the end of a text that is too long to be read."""
    if len(text) <= LONGEST:
        return text
    half = LONGEST // 2
    return f"{text[:half]} ... {text[-half:]}"


class LogError(HydroidError):
    """A log that cannot be used as it is."""


class SettingsError(HydroidError):
    """A setting that does not exist or is not allowed, in a YAML file or an
    override."""


class ModelError(HydroidError):
    """An MJCF model that does not fit the arm's settings."""


class RunError(HydroidError):
    """A run folder that cannot be written, continued or read."""


class Stopped(KeyboardInterrupt):
    """A fit or study that Ctrl-C or a signal ended; its text: what remains of it,
    and what continues it."""
