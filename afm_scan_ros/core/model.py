"""What is believed of a scanner, and the cascades that follow from it."""

from collections.abc import Iterable

from attrs import field, frozen
from attrs.validators import ge, gt, in_

from afm_scan_ros.core.cascade import AnyEffect, Cascade
from afm_scan_ros.core.effects.creep import Creep, CreepModel
from afm_scan_ros.core.effects.gain import Gain
from afm_scan_ros.core.effects.hysteresis.direct import DirectInverse
from afm_scan_ros.core.effects.hysteresis.everett import EverettSurface
from afm_scan_ros.core.effects.hysteresis.preisach import Preisach
from afm_scan_ros.core.effects.vibration import (
    DEFAULT_PREVIEW,
    DEFAULT_WEIGHT,
    InverseDesign,
    Vibration,
    VibrationModel,
)
from afm_scan_ros.core.effects.weights import BrickWallWeight, SmoothWeight, Weight
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.known_error import KnownError

__all__ = [
    "INVERSES",
    "AxisModel",
    "CreepModel",
    "EverettSurface",
    "HysteresisModel",
    "InverseSettings",
    "KnownError",
    "ScannerModel",
    "VibrationModel",
    "compensator",
    "forward",
]

INVERSES = ("creep", "hysteresis", "vibration")


@frozen
class HysteresisModel:
    """``forward``: from drive u (V) to effective input F (V); ``direct``: from F to u."""

    forward: EverettSurface
    direct: EverettSurface


@frozen
class AxisModel:
    """One axis: drive u (V) → hysteresis → F (V) → vibration → creep → displacement (m)."""

    hysteresis: HysteresisModel
    vibration: VibrationModel
    creep: CreepModel
    known_error: KnownError | None = field(default=None, eq=False)
    """What is known of the model, and so no part of it when models are compared or hashed."""


@frozen
class ScannerModel:
    """Both axes, taken as independent of each other."""

    x: AxisModel
    y: AxisModel

    def axis(self, name: str) -> AxisModel:
        """Return the model of axis ``"x"`` or ``"y"``."""
        return {"x": self.x, "y": self.y}[name]


@frozen
class InverseSettings:
    """How to invert: kind of hysteresis inverse, weight of the optimal inverse, preview (s).

    ``hold`` inverts the converter's zero-order hold too; without it G(s) alone is inverted.
    """

    hysteresis_inverse: str = field(default="exact", validator=in_(("exact", "direct")))
    weight: str = field(default="smooth", validator=in_(("smooth", "brick_wall")))
    weight_corner: float = field(default=DEFAULT_WEIGHT.corner, converter=float, validator=gt(0.0))
    weight_order: int = field(default=DEFAULT_WEIGHT.order, validator=ge(1))
    preview: float = field(default=DEFAULT_PREVIEW, converter=float, validator=ge(0.0))
    hold: bool = True

    def design(self) -> InverseDesign:
        """What the vibration inverse needs of these."""
        weight: Weight = BrickWallWeight(self.weight_corner)
        if self.weight == "smooth":
            weight = SmoothWeight(self.weight_corner, self.weight_order)
        return InverseDesign(weight, self.preview, self.hold)


def forward(axis: AxisModel, sample_period: float) -> Cascade:
    """Return the model of one axis, from drive (V) to displacement (m)."""
    return Cascade(
        (
            Preisach(axis.hysteresis.forward),
            Vibration(axis.vibration, sample_period),
            Creep(axis.creep, sample_period),
        )
    )


def compensator(
    axis: AxisModel, sample_period: float, inverses: Iterable[str], settings: InverseSettings
) -> Cascade:
    """Return the cascade whose inverse compensates the effects named in ``inverses``.

    Each other effect is replaced by one gain: creep by 1, vibration by G(0), hysteresis by the
    slope of the major loop from end to end. Raises InputError for an unknown inverse.
    """
    wanted = frozenset(inverses)
    if not wanted <= frozenset(INVERSES):
        unknown = min(wanted - frozenset(INVERSES))
        raise InputError(f"no inverse is named {unknown!r}: choose among {', '.join(INVERSES)}")
    hysteresis: AnyEffect = Gain(axis.hysteresis.forward.chord)
    vibration: AnyEffect = Gain(axis.vibration.static_gain)
    creep: AnyEffect = Gain(1.0)
    if "hysteresis" in wanted:
        exact = settings.hysteresis_inverse == "exact"
        model = axis.hysteresis
        hysteresis = Preisach(model.forward) if exact else DirectInverse(model.direct)
    if "vibration" in wanted:
        vibration = Vibration(axis.vibration, sample_period, settings.design())
    if "creep" in wanted:
        creep = Creep(axis.creep, sample_period)
    return Cascade((hysteresis, vibration, creep))
