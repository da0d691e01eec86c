"""Both operators of hysteresis, as values of a model, and the effect that each describes.

Either has limits ``lower`` and ``upper`` (V) of its input, a ``chord`` (V/V), which is the best
single gain over them, and ``with_share``, which changes its part with memory.
"""

from typing import TypeAlias

from afm_scan_ros.core.effects.base import AnyEffect
from afm_scan_ros.core.effects.hysteresis.duhem import Duhem, DuhemSlopes
from afm_scan_ros.core.effects.hysteresis.everett import EverettSurface
from afm_scan_ros.core.effects.hysteresis.preisach import Preisach

HysteresisOperator: TypeAlias = EverettSurface | DuhemSlopes


def effect_of(operator: HysteresisOperator) -> AnyEffect:
    """Return the effect from drive u (V) to effective input F (V)."""
    return Preisach(operator) if isinstance(operator, EverettSurface) else Duhem(operator)
