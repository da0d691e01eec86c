"""How far the scanner may be from its model: other effects that its records allow as well.

The covariance of the parameters is kept by its few directions that move predictions most. Each is a
variant of the effects. A prediction y has the variance

    s²(t) = Σ_i ((y_i(t) - y_c(t)) / d_i)² + Σ_b (η_b m_b)²

with the predictions y_i of the variants, which differ from the ``centre`` c by d_i standard
deviations, and the model's discrepancy η_b over its rms motion m_b in the band b. The first sum
varies along the drive, and begins with 0 at depolarised rest.
"""

from itertools import pairwise

from attrs import field, frozen

from afm_scan_ros.core.effects.creep import CreepModel
from afm_scan_ros.core.effects.hysteresis.duhem import DuhemSlopes
from afm_scan_ros.core.effects.hysteresis.everett import EverettSurface
from afm_scan_ros.core.effects.hysteresis.preisach import OutputMap
from afm_scan_ros.core.effects.sensor import SensorModel
from afm_scan_ros.core.effects.vibration import VibrationModel
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.types import floats


@frozen(eq=False)
class Variant:
    """Effects of an axis, which differ from others by so many standard ``deviations``."""

    forward: EverettSurface | DuhemSlopes
    output: OutputMap | None
    vibration: VibrationModel
    creep: CreepModel
    sensor: SensorModel | None
    deviations: float = field(default=0.0, converter=float)


@frozen(eq=False)
class Spread:
    """Variants in each of the ``directions``, and the discrepancy's ``shares`` of the motion.

    Only differences between ``centre`` and variants count, about their mean where no record tells
    the rest (``rest_known``). ``bands`` are the n + 1 edges (Hz) of n bands, of one share (1) each.
    """

    centre: Variant
    directions: tuple[Variant, ...]
    bands: tuple[float, ...] = field(converter=floats)
    shares: tuple[float, ...] = field(converter=floats)
    rest_known: bool = True

    def __attrs_post_init__(self) -> None:
        if not all(low < high < float("inf") for low, high in pairwise(self.bands)):
            raise InputError(f"spread: bands must ascend: {self.bands}")
        if len(self.bands) != len(self.shares) + 1:
            raise InputError(
                f"spread has {len(self.bands)} edges of bands: give one share fewer, not"
                f" {len(self.shares)}"
            )
        if not all(0.0 <= share < float("inf") for share in self.shares):
            raise InputError("spread holds what is no share: give finite numbers from 0")
        if not all(0.0 < one.deviations < float("inf") for one in self.directions):
            raise InputError("spread: each direction differs by more than 0 deviations")
