"""A resonance sought by its ripple in all that moves, in the fit of the hysteresis itself.

No free decay is asked for: images show no turns.
"""

from collections.abc import Sequence

import numpy as np
from attrs import evolve
from scipy.signal import argrelmin

from afm_scan_ros.core.effects.vibration import VibrationModel
from afm_scan_ros.core.model import ParameterInterval
from afm_scan_ros.core.types import Array
from afm_scan_ros.features.images.loops.moving import LinearDynamics, MovingRecord, Swept
from afm_scan_ros.features.images.loops.search import Densities, Form, Found, of_logarithm, search

RATIO = 1.06
"""Ratio of neighbouring frequencies that are tried."""
BEST = 3
"""Frequencies tried from which a search begins."""
DAMPINGS = np.log([1e-3, 0.02, 0.5])
"""Least, first and greatest logarithm of the damping ratio."""
CYCLES = 3.0
"""Fewest cycles in a swing, as a loop bends less often."""
ROWS_A_CYCLE = 4.0
"""Fewest rows of a cycle that show it."""


class ResonanceForm(Form):
    """G = 1/(1 + 2ζs/ω + s²/ω²), of the logarithms of ω near a first one (Hz), and of ζ."""

    def __init__(self, hertz: float) -> None:
        first = np.log(2.0 * np.pi * hertz)
        near = 2.0 * np.log(RATIO)
        self.bounds = np.column_stack([[first - near, first, first + near], DAMPINGS])

    def put(self, dynamics: LinearDynamics, values: Array) -> LinearDynamics:
        """Put the resonance in the vibration's place."""
        omega, zeta = (float(each) for each in np.exp(values))
        mode = VibrationModel((1.0,), (1.0 / omega**2, 2.0 * zeta / omega, 1.0))
        return evolve(dynamics, vibration=mode)

    def intervals(self, values: Array, half: Array) -> tuple[ParameterInterval, ...]:
        """Intervals of frequency (Hz) and damping (1)."""
        hertz = float(values[0] - np.log(2.0 * np.pi))
        return (
            of_logarithm("resonance", hertz, half[0], "Hz"),
            of_logarithm("damping", values[1], half[1], "1"),
        )

    def identified(self, values: Array, half: Array) -> bool:  # noqa: ARG002 - as of every form
        """Whether the frequency is known as finely as it was tried."""
        return bool(half[0] < np.log(RATIO))


def rippling(swept: Sequence[Swept], smoothing: float, known: LinearDynamics) -> Found | None:
    """Resonance of gain 1 at rest; None where the records do not identify it.

    Raises ScanError where a search does not converge.
    """
    evidence = Densities(swept, smoothing)
    tried = _tried([one.record for one in swept], min(one.row_period for one in swept))
    misses = np.array([_missed(evidence, known, float(hertz)) for hertz in tried])
    places = sorted(argrelmin(misses, mode="clip")[0], key=lambda place: misses[place])[:BEST]
    found = [search(evidence, known, [ResonanceForm(float(tried[place]))]) for place in places]
    seen = (each for each in found if all(each.identified))
    return min(seen, key=lambda each: float(each.residual @ each.residual), default=None)


def _tried(records: Sequence[MovingRecord], row_period: float) -> Array:
    """Frequencies (Hz) of enough cycles in the fastest swing, and of rows enough in a cycle."""
    lowest = CYCLES * max(one.swings for one in records)
    highest = max(1.0 / (ROWS_A_CYCLE * row_period), lowest)
    return np.asarray(
        np.geomspace(lowest, highest, 1 + int(np.log(highest / lowest) / np.log(RATIO)))
    )


def _missed(evidence: Densities, known: LinearDynamics, hertz: float) -> float:
    form = ResonanceForm(hertz)
    residual = evidence.residual(form.put(known, form.bounds[1]))
    return float(residual @ residual)
