"""What is believed of a scanner."""

from collections.abc import Iterable

from attrs import evolve, field, frozen
from attrs.validators import ge, gt, in_

from afm_scan_ros.core.cascade import Cascade
from afm_scan_ros.core.effect_status import BaseEffects
from afm_scan_ros.core.effects.creep import CreepModel
from afm_scan_ros.core.effects.hysteresis.duhem import DuhemSlopes
from afm_scan_ros.core.effects.hysteresis.everett import EverettSurface
from afm_scan_ros.core.effects.hysteresis.operators import HysteresisOperator, effect_of
from afm_scan_ros.core.effects.hysteresis.output_map import OutputMap
from afm_scan_ros.core.effects.optimal_inverse import SmoothWeight
from afm_scan_ros.core.effects.vibration import (
    DEFAULT_PREVIEW,
    DEFAULT_WEIGHT,
    InverseDesign,
    VibrationModel,
)
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.model_discrepancy import ModelDiscrepancy
from afm_scan_ros.core.types import AXES, floats

__all__ = [
    "INVERSES",
    "Added",
    "AxisModel",
    "CreepModel",
    "DuhemSlopes",
    "EverettSurface",
    "HysteresisModel",
    "InverseSettings",
    "ModelDiscrepancy",
    "OutputMap",
    "ScannerModel",
    "VibrationModel",
]

INVERSES = ("creep", "hysteresis", "vibration")
EXACT, DIRECT, AS_IDENTIFIED = "exact", "direct", "as_identified"
"""Inverses of hysteresis; the last is whichever the model states to be better for its axis."""


@frozen
class HysteresisModel:
    """``forward``: from drive u (V) to effective input F (V); ``direct``: from F to u.

    ``output`` is the map behind a Preisach operator ``forward``, where there is one; a Duhem
    operator contains its maps. ``inverse`` is the one that was
    better on held-out loops: the exact inverse of the two, or the direct surface.
    """

    forward: HysteresisOperator
    direct: EverettSurface
    output: OutputMap | None = None
    inverse: str = field(default=EXACT, validator=in_((EXACT, DIRECT)))

    @property
    def surface(self) -> EverettSurface:
        """Surface of a Preisach operator ``forward``; raises InputError for another operator."""
        if isinstance(self.forward, EverettSurface):
            return self.forward
        raise InputError("the hysteresis is a Duhem operator: it has no Everett surface")

    def operator(self) -> Cascade:
        """Return the effect from u to F, whose inverse is the exact one."""
        behind = () if self.output is None else (self.output,)
        return Cascade((effect_of(self.forward), *behind))


@frozen
class Added:
    """An effect of the catalogue that was found on an axis, with the values of its parameters.

    ``name`` and ``kind`` are the catalogue's; ``values``, in SI units, are in its order.
    """

    name: str
    kind: str
    values: tuple[float, ...] = field(converter=floats)


@frozen
class AxisModel:
    """One axis: drive u (V) → hysteresis → F (V) → vibration → creep → displacement (m).

    ``added`` are effects beyond the paper's, in the order in which they were found.
    """

    hysteresis: HysteresisModel
    vibration: VibrationModel
    creep: CreepModel
    model_discrepancy: ModelDiscrepancy | None = field(default=None, eq=False)
    """What is known of the model, and so no part of it when models are compared or hashed."""
    added: tuple[Added, ...] = ()
    known_elsewhere: tuple[ModelDiscrepancy, ...] = field(default=(), eq=False)
    """The same on other records, of other amplitudes or bands; these may have been fitted."""
    effects: BaseEffects = field(default=BaseEffects(), eq=False)
    """How each base effect is known, and where it holds."""

    @property
    def model_discrepancies(self) -> tuple[ModelDiscrepancy, ...]:
        """All that is known of the model's error; empty where nothing is."""
        return (
            ()
            if self.model_discrepancy is None
            else (self.model_discrepancy, *self.known_elsewhere)
        )

    def also_known(self, errors: Iterable[ModelDiscrepancy]) -> "AxisModel":
        """Return the model that knows its error on further records too."""
        known = (*self.model_discrepancies, *errors)
        if not known:
            return self
        return evolve(self, model_discrepancy=known[0], known_elsewhere=known[1:])


@frozen
class ScannerModel:
    """One axis or both, independent of each other but for what was added to either.

    Raises InputError where there is none.
    """

    x: AxisModel | None = None
    y: AxisModel | None = None

    def __attrs_post_init__(self) -> None:
        if not self.axes:
            raise InputError("a model holds no axis: give x, y or both")

    @property
    def axes(self) -> tuple[str, ...]:
        """Names of the axes that the model holds."""
        return tuple(name for name in AXES if getattr(self, name) is not None)

    def axis(self, name: str) -> AxisModel:
        """Return the model of axis ``"x"`` or ``"y"``; raises InputError where it is absent."""
        found = {"x": self.x, "y": self.y}[name]
        if found is None:
            raise InputError(f"the model holds no axis {name}: identify {name} too")
        return found


@frozen
class InverseSettings:
    """How to invert: kind of hysteresis inverse, weight of the optimal inverse, preview (s)."""

    hysteresis_inverse: str = field(
        default=AS_IDENTIFIED, validator=in_((AS_IDENTIFIED, EXACT, DIRECT))
    )
    weight_corner: float = field(default=DEFAULT_WEIGHT.corner, converter=float, validator=gt(0.0))
    weight_order: int = field(default=DEFAULT_WEIGHT.order, validator=ge(1))
    preview: float = field(default=DEFAULT_PREVIEW, converter=float, validator=ge(0.0))

    def design(self) -> InverseDesign:
        """What the vibration inverse needs of these."""
        return InverseDesign(SmoothWeight(self.weight_corner, self.weight_order), self.preview)
