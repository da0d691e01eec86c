"""The effective input F of a measured displacement: creep and vibration inverted.

Creep is inverted exactly, vibration by the optimal inverse of Croft, Shed and Devasia (2001),
Eq. 22, with R/Q = (f / f_c)⁶. The corner f_c lies just below the resonance: drives are slow, and
what is faster is noise.
"""

from afm_scan_ros.core.effects.creep import Creep
from afm_scan_ros.core.effects.optimal_inverse import SmoothWeight
from afm_scan_ros.core.effects.vibration import Vibration
from afm_scan_ros.core.model import AxisModel
from afm_scan_ros.core.types import Array

CORNER, STEEPNESS = 0.88, 3
"""Of f_c over the resonance, and half of the power with which R/Q grows."""


def effective_input(model: AxisModel, displacement: Array, sample_period: float) -> Array:
    """F (V) of a displacement (m), both (n,), of a scanner that begins at rest."""
    rigid = without_creep(model, displacement, sample_period)
    weight = SmoothWeight(CORNER * model.vibration.natural_frequency, STEEPNESS)
    return Vibration(model.vibration, sample_period, weight).inverse.invert_whole(rigid)


def without_creep(model: AxisModel, displacement: Array, sample_period: float) -> Array:
    """Return a displacement (m), (n,), as it were without creep (Eq. 10)."""
    creep = Creep(model.creep, sample_period)
    return creep.invert(creep.inverse_at_rest(), displacement)[1]
