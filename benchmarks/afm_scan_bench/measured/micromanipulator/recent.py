"""Arrays that were found of late, kept for when they are asked for again."""

from collections import OrderedDict
from collections.abc import Callable, Hashable

from attrs import define, field

from afm_scan_ros.core.types import Array


@define(eq=False)
class Recent:
    """The arrays asked for last, as many as find ``room`` (bytes), and one in any case.

    A fit alters one value after another and comes back to those of before.
    """

    room: int
    _known: OrderedDict[Hashable, Array] = field(factory=OrderedDict, init=False)

    def of(self, key: Hashable, find: Callable[[], Array]) -> Array:
        """Array of a key, found where it is not known."""
        if key not in self._known:
            self._known[key] = find()
        self._known.move_to_end(key)
        while len(self._known) > 1 and sum(a.nbytes for a in self._known.values()) > self.room:
            self._known.popitem(last=False)
        return self._known[key]
