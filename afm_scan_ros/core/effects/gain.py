"""A plain gain: what stands in for an effect whose inverse is switched off."""

import numpy as np

from afm_scan_ros.core.types import Array


class Gain:
    """Output = gain * input; nothing is remembered, so the state is None."""

    def __init__(self, gain: float) -> None:
        self._gain = gain

    def at_rest(self) -> None:
        """Return no state."""

    def apply(self, state: None, block: Array) -> tuple[None, Array]:  # noqa: ARG002 - Effect's
        """Outputs for a block of inputs, both (n,)."""
        return None, self._gain * block

    def inverse_at_rest(self) -> None:
        """Return no state."""

    def invert(self, state: None, block: Array) -> tuple[None, Array]:  # noqa: ARG002 - Effect's
        """Inputs for a block of outputs, both (n,)."""
        return None, block / self._gain

    def finish(self, state: None) -> Array:  # noqa: ARG002 - Effect's
        """Return nothing: no sample is ever owed."""
        return np.empty(0)
