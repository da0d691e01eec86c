"""Effects by further physics, as large as those of sizes.py; three of them in no catalogue.

A name is that of the effect, and the mechanism's. Sizes were set by what a mechanism adds to the
true displacement alone. Whether they have been looked at in tuning, docs/diagnosis.md says.
"""

from afm_scan_ros.simulation.mechanisms.boiling_cryostat import BoilingCryostat
from afm_scan_ros.simulation.mechanisms.bursting_supply import BurstingSupply
from afm_scan_ros.simulation.mechanisms.effect import Effect
from afm_scan_ros.simulation.mechanisms.late_divider import LateDivider
from afm_scan_ros.simulation.mechanisms.pipelined_sensor import PipelinedSensor
from afm_scan_ros.simulation.mechanisms.pressed_balls import PressedBalls
from afm_scan_ros.simulation.mechanisms.regulated_stage import RegulatedStage
from afm_scan_ros.simulation.mechanisms.thinning_blocks import ThinningBlocks
from afm_scan_ros.simulation.mechanisms.worn_bearing import WornBearing

FURTHER = {
    "delay_pipelined": Effect(
        "delay",
        lambda axis, clock: PipelinedSensor(axis=axis, clock=clock),
        (4.9e-6, 14.3e-6, 49e-6),
    ),
    "rate_dependent_hysteresis_thinning": Effect(
        "rate_dependent_hysteresis",
        lambda axis, film: ThinningBlocks(axis=axis, film=film),
        (0.315e-6, 2.85e-6, 34e-6),
    ),
    "drift_regulated": Effect(
        "drift",
        lambda axis, growth: RegulatedStage(axis=axis, growth=growth, period=12.0, damping=0.3),
        (300e-9, 900e-9, 3000e-9),
    ),
    "periodic_disturbance_bearing": Effect(
        "periodic_disturbance",
        lambda axis, knock: WornBearing(axis=axis, amplitude=knock, shaft=24.3),
        (43e-9, 130e-9, 433e-9),
    ),
    "hysteretic_stiffness_balls": Effect(
        "hysteretic_stiffness",
        lambda axis, share: PressedBalls(axis=axis, share=share, reach=12e-6),
        (0.0062, 0.0186, 0.062),
    ),
    "bursting_supply": Effect(
        None,
        lambda axis, sag: BurstingSupply(axis=axis, sag=sag, bursts=137.0),
        (0.0117, 0.0351, 0.117),
    ),
    "late_divider": Effect(
        None,
        lambda axis, reach: LateDivider(axis=axis, reach=reach, settling=2.7e-3),
        (182e-6, 105e-6, 59e-6),
    ),
    "boiling_cryostat": Effect(
        None,
        lambda axis, knock: BoilingCryostat(axis=axis, amplitude=knock),
        (52e-9, 156e-9, 520e-9),
    ),
}
