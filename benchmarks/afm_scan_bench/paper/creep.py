"""Creep of both axes as Croft, Shed and Devasia (2001) publish it."""

from afm_scan_ros.core.effects.creep import CreepModel

CREEP_X = CreepModel.from_transfer_function(
    (1.0, 0.630, 0.0216, 6.25e-5), (1.0, 0.516, 0.0171, 4.69e-5)
)
"""Eq. 6."""

CREEP_Y = CreepModel.from_transfer_function(
    (1.0, 0.589, 0.0233, 1.48e-5), (1.0, 0.517, 0.0197, 1.14e-5)
)
"""Eq. 9."""
