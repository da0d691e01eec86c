"""The same effects by other physics than those of sizes.py, and as large; some in no catalogue.

A name is that of the effect, and the mechanism's. Those from ``input_lag_buffered`` on were a kept
set, and have been opened (docs/diagnosis.md says when): all are looked at in tuning. The arc was in
no catalogue then, and has become a form of cross_coupling since.
"""

from afm_scan_ros.simulation.mechanisms.averaging_sensor import AveragingSensor
from afm_scan_ros.simulation.mechanisms.buffered_amplifier import BufferedAmplifier
from afm_scan_ros.simulation.mechanisms.effect import CAPACITANCE, Effect
from afm_scan_ros.simulation.mechanisms.fading_gain import FadingGain
from afm_scan_ros.simulation.mechanisms.hardened_domains import HardenedDomains
from afm_scan_ros.simulation.mechanisms.hastened_blocks import HastenedBlocks
from afm_scan_ros.simulation.mechanisms.heated_rod import HeatedRod
from afm_scan_ros.simulation.mechanisms.polymer_pad import PolymerPad
from afm_scan_ros.simulation.mechanisms.popping_mount import PoppingMount
from afm_scan_ros.simulation.mechanisms.rubbing_guide import RubbingGuide
from afm_scan_ros.simulation.mechanisms.saturating_sensor import SaturatingSensor
from afm_scan_ros.simulation.mechanisms.shared_ground import SharedGround
from afm_scan_ros.simulation.mechanisms.springy_joint import SpringyJoint
from afm_scan_ros.simulation.mechanisms.sprung_holder import SprungHolder
from afm_scan_ros.simulation.mechanisms.supply_ripple import SupplyRipple
from afm_scan_ros.simulation.mechanisms.swinging_arm import SwingingArm
from afm_scan_ros.simulation.mechanisms.tired_amplifier import TiredAmplifier

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
    "input_lag_buffered": Effect(
        "input_lag",
        lambda axis, slower: BufferedAmplifier(axis=axis, slower=slower, ratio=0.25),
        (32e-6, 94e-6, 320e-6),
    ),
    "extra_resonance_holder": Effect(
        "extra_resonance",
        lambda axis, hertz: SprungHolder(axis=axis, frequency=hertz, damping=0.02),
        (1400.0, 1100.0, 890.0),
    ),
    "cross_coupling_ground": Effect(
        "cross_coupling",
        lambda axis, share: SharedGround(axis=axis, share=share, time_constant=50e-6),
        (3e-3, 9e-3, 30e-3),
    ),
    "slow_creep_polymer": Effect(
        "slow_creep",
        lambda axis, share: PolymerPad(axis=axis, share=share, power=0.25),
        (0.01, 0.03, 0.1),
    ),
    "slew_limit_tired": Effect(
        "slew_limit",
        lambda axis, ampere: TiredAmplifier(
            axis=axis, current=ampere, resistance=5.0, capacitance=CAPACITANCE
        ),
        (60e-6, 48e-6, 38e-6),
    ),
    "parameter_shift_domains": Effect(
        "parameter_shift",
        lambda axis, factor: HardenedDomains(axis=axis, factor=factor),
        (1.007, 1.02, 1.07),
    ),
    "backlash_springy": Effect(
        "backlash",
        lambda axis, gap: SpringyJoint(axis=axis, gap=gap, share=0.1),
        (45e-9, 135e-9, 450e-9),
    ),
    "fading_gain": Effect(
        None,
        lambda axis, loss: FadingGain(axis=axis, loss=loss, settling=2.0),
        (0.009, 0.027, 0.09),
    ),
    "arc": Effect(
        "cross_coupling",
        lambda axis, radius: SwingingArm(axis=axis, radius=radius),
        (2.2e-3, 0.7e-3, 0.22e-3),
    ),
    "popping": Effect(
        None,
        lambda axis, jump: PoppingMount(axis=axis, jump=jump, dwell=0.02),
        (80e-9, 240e-9, 800e-9),
    ),
}
