"""A plain gain, in the place of an effect whose inverse is switched off: output = gain * input."""

from attrs import frozen

from afm_scan_ros.core.effects.base import StatelessEffect
from afm_scan_ros.core.types import Array


@frozen
class Gain(StatelessEffect):
    """A gain, in the unit of the output over that of the input."""

    gain: float

    def output(self, inputs: Array) -> Array:
        """Outputs for inputs, both (n,)."""
        return self.gain * inputs

    def input(self, outputs: Array) -> Array:
        """Inputs for outputs, both (n,)."""
        return outputs / self.gain
