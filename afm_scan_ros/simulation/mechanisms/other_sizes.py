"""The same effects by other physics than those of sizes.py, and as large.

A name is that of the effect, and the mechanism's.
"""

from afm_scan_ros.simulation.mechanisms.averaging_sensor import AveragingSensor
from afm_scan_ros.simulation.mechanisms.effect import Effect
from afm_scan_ros.simulation.mechanisms.hastened_blocks import HastenedBlocks
from afm_scan_ros.simulation.mechanisms.heated_rod import HeatedRod
from afm_scan_ros.simulation.mechanisms.rubbing_guide import RubbingGuide
from afm_scan_ros.simulation.mechanisms.saturating_sensor import SaturatingSensor
from afm_scan_ros.simulation.mechanisms.supply_ripple import SupplyRipple

OTHERS = {
    "delay_averaging": Effect(
        "delay",
        lambda axis, window: AveragingSensor(axis=axis, window=window),
        (80e-6, 240e-6, 800e-6),
    ),
    "drift_rod": Effect(
        "drift",
        lambda axis, growth: HeatedRod(axis=axis, growth=growth, diffusion_time=400.0),
        (1.8e-6, 5.4e-6, 18e-6),
    ),
    "static_nonlinearity_gauge": Effect(
        "static_nonlinearity",
        lambda axis, reach: SaturatingSensor(axis=axis, reach=reach, offset=5e-6),
        (230e-6, 135e-6, 75e-6),
    ),
    "hysteretic_stiffness_guide": Effect(
        "hysteretic_stiffness",
        lambda axis, share: RubbingGuide(axis=axis, share=share, reaches=(2e-6, 6e-6)),
        (0.0135, 0.04, 0.135),
    ),
    "periodic_disturbance_supply": Effect(
        "periodic_disturbance",
        lambda axis, volt: SupplyRipple(axis=axis, amplitude=volt, frequency=100.0),
        (0.018, 0.054, 0.18),
    ),
    "rate_dependent_hysteresis_hastened": Effect(
        "rate_dependent_hysteresis",
        lambda axis, hardening: HastenedBlocks(axis=axis, hardening=hardening),
        (140e-6, 420e-6, 1400e-6),
    ),
}
