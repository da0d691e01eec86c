"""The numbers of Croft, Shed and Devasia (2001) that this package takes over."""

from afm_scan_ros.core.effects.creep import CreepModel
from afm_scan_ros.core.effects.vibration import VibrationModel

SENSOR_SENSITIVITY = 8.0e-6
"""m per sensor volt: an assumption of this package, the paper publishes none."""

VIBRATION_X = VibrationModel(
    tuple(SENSOR_SENSITIVITY * c for c in (0.435, 3910.0, 1.21e7, 1.07e14)),
    (1.0, 8980.0, 2.78e7, 7.38e10, 1.55e14),
)
"""Eq. 5."""

CREEP_X = CreepModel.from_transfer_function(
    (1.0, 0.630, 0.0216, 6.25e-5), (1.0, 0.516, 0.0171, 4.69e-5)
)
"""Eq. 6."""

CREEP_Y = CreepModel.from_transfer_function(
    (1.0, 0.589, 0.0233, 1.48e-5), (1.0, 0.517, 0.0197, 1.14e-5)
)
"""Eq. 9."""
