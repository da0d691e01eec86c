"""The numbers of Croft, Shed and Devasia (2001) that this package takes over."""

from afm_scan_ros.core.effects.vibration import VibrationModel

SENSOR_SENSITIVITY = 8.0e-6
"""m per sensor volt: an assumption of this package, the paper publishes none."""

VIBRATION_X = VibrationModel(
    tuple(SENSOR_SENSITIVITY * c for c in (0.435, 3910.0, 1.21e7, 1.07e14)),
    (1.0, 8980.0, 2.78e7, 7.38e10, 1.55e14),
)
"""Eq. 5."""
