"""What a fit has tried of single joints, and what that gained."""

from hydroid.fitting.left_out import Gain


class Tried:
    """What terms of single joints gained.

    Attributes:
        gains: of each term, on its joint alone. None: it was not refined, as it
            promises too little or noise alone is left. A term that was dropped of all
            joints together has what it gained there.
    """

    def __init__(self) -> None:
        self.gains = dict[str, Gain | None]()
        self._dropped = set[str]()

    def alone(self, gained: Gain | None, *terms: str) -> None:
        """Note what terms together gained on their joint alone.

        It is not noted where all joints together have decided on a term, nor is None
        where it was refined before.
        """
        for term in terms:
            is_news = gained is not None or self.gains.get(term) is None
            if term not in self._dropped and is_news:
                self.gains[term] = gained

    def dropped(self, gained: Gain, *terms: str) -> None:
        """Note what terms gained of all joints together, which do not keep them."""
        for term in terms:
            self._dropped.add(term)
            self.gains[term] = gained
