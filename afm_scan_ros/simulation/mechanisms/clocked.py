"""What goes by the clock: by the time since the scan began, and by what chance drew at first."""

from abc import abstractmethod
from typing import Any

import numpy as np

from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.mechanisms.base import Insert


class Clocked(Insert):
    """A mechanism that remembers no signal; state: elapsed steps, and what was drawn."""

    @abstractmethod
    def drawn(self, rng: np.random.Generator) -> Any:  # noqa: ANN401 - each its own
        """What differs from one scan to the next."""

    @abstractmethod
    def at(self, time: Array, own: Array, drawn: Any) -> Array:  # noqa: ANN401
        """Signal after the mechanism at these instants (s), all of shape (n,)."""

    def at_rest(self, step: float, rng: np.random.Generator) -> tuple[int, Any]:  # noqa: ARG002
        """The scan begins."""
        return 0, self.drawn(rng)

    def act(
        self,
        state: tuple[int, Any],
        own: Array,
        other: Array,  # noqa: ARG002
        step: float,
    ) -> tuple[tuple[int, Any], Array]:
        """Signal of the axis by the clock; a drive's instants are the middles of its steps."""
        elapsed, drawn = state
        within = 0.5 if self.PLACE == "drive" else 0.0
        time = step * (np.arange(elapsed, elapsed + own.size, dtype=np.float64) + within)
        return (elapsed + own.size, drawn), self.at(time, own, drawn)
