"""Sizes of a scanner over those of a reference scanner.

The catalogue states bounds, steps and starting values for a reference scanner of the size of Croft
et al. (2001). For another scanner, lengths scale with its range, voltages with its drive, and times
with the period of its first resonance.
"""

from functools import cache
from math import prod

from attrs import frozen

from afm_scan_ros.core.effects.vibration import VibrationModel, first_resonance
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.model import AxisModel

REFERENCE_VOLTAGE, REFERENCE_LENGTH, REFERENCE_RESONANCE = 4.0, 22.09e-6, 454.0
"""Drive (V) and displacement (m) to one side, and first resonance (Hz) of the reference scanner."""
SAMPLES_A_PERIOD = 2.0
"""Samples in a period of the first resonance where none is known: it lies beyond the records."""


@frozen
class Scale:
    """Unit of length, voltage and time of a scanner over those of the reference scanner."""

    length: float = 1.0
    voltage: float = 1.0
    time: float = 1.0

    def factor(self, unit: str) -> float:
        """Size of a quantity over that of the reference scanner; ``unit`` is as 1/m2 or V/s."""
        powers = _powers(unit)
        return prod(
            float(base**power)
            for base, power in zip((self.length, self.voltage, self.time), powers, strict=True)
        )


@cache
def _powers(unit: str) -> tuple[int, int, int]:
    """Powers of length, voltage and time in a unit."""
    above, _, below = unit.partition("/")
    found = {"m": 0, "V": 0, "s": 0}
    for symbol, sign in ((above, 1), (below, -1)):
        name = symbol.rstrip("0123456789")
        if name == "Hz":
            found["s"] -= sign
        elif name:
            found[name] += sign * int(symbol[len(name) :] or 1)
    return found["m"], found["V"], found["s"]


def voltage_scale(model: AxisModel) -> float:
    """Largest drive of a model over that of the reference scanner."""
    forward = model.hysteresis.forward
    return max(map(abs, forward.drive_range)) / REFERENCE_VOLTAGE


def length_scale(model: AxisModel) -> float:
    """Displacement at the largest drive of a model over that of the reference scanner."""
    gain = abs(model.hysteresis.forward.chord * model.vibration.static_gain)
    return voltage_scale(model) * REFERENCE_VOLTAGE * gain / REFERENCE_LENGTH


def half_range_of(model: AxisModel) -> float:
    """Displacement (m) from the middle to an end of the identified range, when slow."""
    forward = model.hysteresis.forward
    lower, upper = forward.drive_range
    return 0.5 * (upper - lower) * abs(forward.chord * model.vibration.static_gain)


def resonance_of(vibration: VibrationModel, sample_period: float) -> float:
    """First resonance (Hz) of a model; without one, the Nyquist frequency of a period (s)."""
    try:
        return first_resonance(vibration).frequency
    except InputError:
        return 1.0 / (SAMPLES_A_PERIOD * sample_period)


def scale_of(model: AxisModel) -> Scale:
    """Scale of a model; without a resonance, times are those of its model discrepancy's record."""
    known = model.model_discrepancy
    period = 0.5 / known.bands[-1] if known else 1.0 / (SAMPLES_A_PERIOD * REFERENCE_RESONANCE)
    time = REFERENCE_RESONANCE / resonance_of(model.vibration, period)
    return Scale(length_scale(model), voltage_scale(model), time)
