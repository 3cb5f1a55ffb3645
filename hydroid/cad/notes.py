"""What an import assumed, left out or mended: a line for each kind, with the parts that it concerns."""

from collections.abc import Sequence

from hydroid.words import listed


class Notes:
    """Sentences with the names of what they are about, in the order of their first use."""

    def __init__(self) -> None:
        self._parts: dict[str, list[str]] = {}

    def add(self, sentence: str, *parts: str) -> None:
        """Say a sentence about parts of the robot; the parts of equal sentences stand in one line."""
        names = self._parts.setdefault(sentence, [])
        names += [part for part in parts if part not in names]

    def lines(self) -> Sequence[str]:
        """Return a line for each sentence."""
        return [f"{listed(parts, 4)}: {what}" if parts else what for what, parts in self._parts.items()]
