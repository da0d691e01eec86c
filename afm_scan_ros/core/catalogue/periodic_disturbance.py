"""Periodic disturbance: the scanner moves at a frequency of its own, driven or not.

Equation: x(t) = x₀(t) + a cos(2π f t) + b sin(2π f t), t from the record's first sample; a and b
in m, f in Hz. Sources: the mains, a pump, a fan, an acoustic mode of the room.
"""

from collections.abc import Iterator

import numpy as np
from attrs import frozen

from afm_scan_ros.core.catalogue.amounts import amounts
from afm_scan_ros.core.catalogue.entry import Entry, Form, Parameter
from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.tracing.clues import Clues
from afm_scan_ros.core.types import Array

COSINE = Parameter("cosine", "m", -1e-5, 1e-5, 1e-12, own=True)
SINE = Parameter("sine", "m", -1e-5, 1e-5, 1e-12, own=True)
FREQUENCY = Parameter("frequency", "Hz", 0.01, 5e4, 1e-6)
LINES = 3


@frozen
class Disturbance:
    """Motion with time, which an inverse leaves alone; the state is the index of the next sample.

    At what phase the next scan will meet it nobody knows, so there is nothing to subtract.
    """

    cosine: float
    sine: float
    frequency: float
    sample_period: float

    def at_rest(self) -> int:
        """Index of the first sample."""
        return 0

    def apply(self, state: int, block: Array) -> tuple[int, Array]:
        """Displacement with the disturbance, of one without, both (n,) in m."""
        after = state + len(block)
        time = self.sample_period * np.arange(state, after, dtype=np.float64)
        late = np.arctan2(self.sine, self.cosine)
        wave = np.cos(2.0 * np.pi * self.frequency * time - late)
        return after, block + np.hypot(self.cosine, self.sine) * wave

    def inverse_at_rest(self) -> None:
        """Return no state."""

    def invert(self, state: None, block: Array) -> tuple[None, Array]:  # noqa: ARG002 - Effect's
        """Return the targets unchanged."""
        return None, block

    def finish(self, state: None) -> Array:  # noqa: ARG002 - Effect's
        """Return nothing: no sample is ever owed."""
        return np.empty(0)


def insert(chain: Chain, values: Array) -> Chain:
    """Disturb the output: amplitudes (m) of cosine and sine, frequency (Hz)."""
    cosine, sine, frequency = values
    return chain.with_output(lambda period: Disturbance(cosine, sine, frequency, period))


def starts(clues: Clues) -> Iterator[tuple[float, float, float]]:
    """The residual's lines, with their amplitudes."""
    time = clues.sample_period * np.arange(len(clues.residual), dtype=np.float64)
    for frequency in clues.prominent[:LINES] or (50.0,):
        phase = 2.0 * np.pi * frequency * time
        cosine, sine = amounts(clues.residual, np.cos(phase), np.sin(phase))
        yield COSINE.nearest(cosine), SINE.nearest(sine), FREQUENCY.nearest(frequency)


ENTRY = Entry(
    name="periodic_disturbance",
    equation="x = x0 + cosine cos(2 pi frequency t) + sine sin(2 pi frequency t)",
    needs="a record of many periods; best one at rest, where nothing else moves",
    confusable=("drift", "extra_resonance"),
    experiment="rest",
    remedy="none",
    advice="its phase is unknown when the next scan begins: find its source and remove it, or lock"
    " the line rate to it, so that each line meets it alike",
    forms=(
        Form(
            "",
            (COSINE, SINE, FREQUENCY),
            insert,
            starts,
            (0.0, 0.0, 50.0),
        ),
    ),
)
