"""Hysteresis, lag and creep of one axis whose records come from negative saturation."""

import numpy as np
from attrs import frozen

from afm_scan_ros.core.cascade import Cascade, States
from afm_scan_ros.core.effects.creep import Creep, CreepModel
from afm_scan_ros.core.effects.hysteresis.everett import EverettSurface
from afm_scan_ros.core.effects.hysteresis.preisach import Preisach
from afm_scan_ros.core.effects.vibration import InverseDesign, Vibration, VibrationModel
from afm_scan_ros.core.types import Array


@frozen
class LoopModel:
    """Drive u (V) → hysteresis → F (V) → lag → creep → displacement (m), all at one sample period.

    The gauge: F runs from 0 at negative saturation over as many volts as the drive. So a record
    that comes from negative saturation comes from rest, and displacement is counted from there.
    """

    surface: EverettSurface
    vibration: VibrationModel
    creep: CreepModel
    sample_period: float

    def apply(self, drive: Array) -> Array:
        """Displacement (m) under a drive (V), both (n,)."""
        cascade = self._cascade()
        states = self._saturated(cascade.at_rest())
        return cascade.apply(states, drive)[1]

    def invert(self, displacement: Array, design: InverseDesign) -> Array:
        """Drive (V) for a displacement (m), both (n,). Raises BeyondRangeError out of range."""
        cascade = self._cascade(design)
        states = self._saturated(cascade.inverse_at_rest())
        states, drive = cascade.invert(states, displacement)
        return np.concatenate((drive, cascade.finish(states)))

    def _cascade(self, design: InverseDesign | None = None) -> Cascade:
        return Cascade(
            (
                Preisach(self.surface),
                Vibration(self.vibration, self.sample_period, design),
                Creep(self.creep, self.sample_period),
            )
        )

    def _saturated(self, states: States) -> States:
        return (Preisach(self.surface).saturated(), *states[1:])
