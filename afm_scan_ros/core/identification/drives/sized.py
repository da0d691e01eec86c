"""An experiment of the library with its amplitude and length, and the choices of both."""

from collections.abc import Iterator
from itertools import product

from attrs import frozen

from afm_scan_ros.core.identification.drives.excitation import Plan
from afm_scan_ros.core.identification.drives.experiments import EXPERIMENTS
from afm_scan_ros.core.identification.drives.waveforms import Waveform
from afm_scan_ros.core.model import ScannerModel

SIZES = 1.0, 2.0, 0.5, 4.0, 8.0, 0.25
"""Amplitudes over that of the library."""
LENGTHS = 0.125, 0.25, 0.5, 1.0, 2.0
"""Lengths over that of the library. A drive whose times are the scanner's is never shortened."""


@frozen
class SizedExperiment:
    """An experiment, its ``amplitude`` (V, from the middle of the drive) and ``duration`` (s)."""

    name: str
    amplitude: float
    duration: float

    @classmethod
    def of_library(cls, name: str, model: ScannerModel) -> "SizedExperiment":
        """Return an experiment of the library, for the scanner of a model."""
        listed = EXPERIMENTS[name]
        return cls(name, listed.amplitude_for(model), listed.duration_for(model))

    def plan_for(self, model: ScannerModel) -> Plan[Waveform]:
        """Return the drive for the scanner of a model."""
        return EXPERIMENTS[self.name].plan_for(model, self.amplitude, self.duration)

    def enlarged(self, model: ScannerModel) -> bool:
        """Whether its amplitude exceeds that of the library."""
        return self.amplitude > EXPERIMENTS[self.name].amplitude_for(model)

    def varied(self, model: ScannerModel) -> Iterator["SizedExperiment"]:
        """Yield other amplitudes and lengths within the range of a model, the shortest first."""
        listed = EXPERIMENTS[self.name]
        lengths = [length for length in LENGTHS if length >= 1.0 or not listed.stage]
        for length, size in product(lengths, SIZES if self.amplitude else SIZES[:1]):
            other = SizedExperiment(self.name, size * self.amplitude, length * self.duration)
            if other != self and other.amplitude <= listed.largest_for(model):
                yield other
