"""Counts the parts of a search while more of them are planned."""

from collections import Counter

from attrs import define, field

from afm_scan_ros.core.types import ProgressCallback, Step


@define
class Tally:
    """Counts the parts of a search, of which more are planned as it goes on.

    Parts that are ``named`` apart, as those of each axis, are counted together.
    """

    _progress: ProgressCallback
    _name: str = ""
    _counts: Counter[str] = field(factory=Counter)

    def named(self, name: str) -> "Tally":
        """Return a tally that begins what it says with a name."""
        return Tally(self._progress, f"{self._name}{name}", self._counts)

    def plan(self, parts: int) -> None:
        """Count parts that are to be done, or fewer of them where ``parts`` is negative."""
        self._counts["planned"] += parts

    def begin(self, doing: str, parts: int = 1) -> None:
        """Say what is being done, which takes so many of the parts that are planned."""
        done, planned = self._counts["done"], self._counts["planned"]
        self._progress(Step(f"{self._name}{doing}", done, planned, more=True))
        self._counts["done"] += parts
