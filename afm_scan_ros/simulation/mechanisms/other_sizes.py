"""The same effects by other physics than those of sizes.py, and as large; some in no catalogue.

A name is that of the effect, and the mechanism's. Those from ``input_lag_buffered`` on, and those
from ``delay_linear_phase`` on, were kept sets, and have been opened (docs/diagnosis.md says when):
all are looked at in tuning. The arc was in no catalogue then, and has become a form of
cross_coupling since.
"""

from afm_scan_ros.simulation.mechanisms.activated_blocks import ActivatedBlocks
from afm_scan_ros.simulation.mechanisms.averaging_sensor import AveragingSensor
from afm_scan_ros.simulation.mechanisms.buffered_amplifier import BufferedAmplifier
from afm_scan_ros.simulation.mechanisms.compressing_amplifier import CompressingAmplifier
from afm_scan_ros.simulation.mechanisms.effect import Effect
from afm_scan_ros.simulation.mechanisms.fading_gain import FadingGain
from afm_scan_ros.simulation.mechanisms.glitching_converter import GlitchingConverter
from afm_scan_ros.simulation.mechanisms.hardened_domains import HardenedDomains
from afm_scan_ros.simulation.mechanisms.hastened_blocks import HastenedBlocks
from afm_scan_ros.simulation.mechanisms.heated_rod import HeatedRod
from afm_scan_ros.simulation.mechanisms.linear_phase_sensor import LinearPhaseSensor
from afm_scan_ros.simulation.mechanisms.polymer_pad import PolymerPad
from afm_scan_ros.simulation.mechanisms.popping_mount import PoppingMount
from afm_scan_ros.simulation.mechanisms.relaxing_clamp import RelaxingClamp
from afm_scan_ros.simulation.mechanisms.ringing_amplifier import RingingAmplifier
from afm_scan_ros.simulation.mechanisms.rubbing_guide import RubbingGuide
from afm_scan_ros.simulation.mechanisms.saturating_sensor import SaturatingSensor
from afm_scan_ros.simulation.mechanisms.shared_ground import SharedGround
from afm_scan_ros.simulation.mechanisms.sliding_sample import SlidingSample
from afm_scan_ros.simulation.mechanisms.springy_joint import SpringyJoint
from afm_scan_ros.simulation.mechanisms.sprung_holder import SprungHolder
from afm_scan_ros.simulation.mechanisms.stribeck_guide import StribeckGuide
from afm_scan_ros.simulation.mechanisms.supply_ripple import SupplyRipple
from afm_scan_ros.simulation.mechanisms.swinging_arm import SwingingArm
from afm_scan_ros.simulation.mechanisms.thumping_compressor import ThumpingCompressor
from afm_scan_ros.simulation.mechanisms.tired_amplifier import TiredAmplifier
from afm_scan_ros.simulation.mechanisms.uneven_converter import UnevenConverter

CAPACITANCE = 100e-9  # F, of the piezo

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
    "delay_linear_phase": Effect(
        "delay",
        lambda axis, delay: LinearPhaseSensor(axis=axis, delay=delay),
        (17e-6, 50e-6, 170e-6),
    ),
    "rate_dependent_hysteresis_activated": Effect(
        "rate_dependent_hysteresis",
        lambda axis, volt: ActivatedBlocks(axis=axis, activation=volt, slip_speed=20.0),
        (3e-3, 9e-3, 30e-3),
    ),
    "drift_clamp": Effect(
        "drift",
        lambda axis, scale: RelaxingClamp(axis=axis, scale=scale, settling=0.5),
        (310e-9, 930e-9, 3.1e-6),
    ),
    "periodic_disturbance_compressor": Effect(
        "periodic_disturbance",
        lambda axis, knock: ThumpingCompressor(axis=axis, amplitude=knock, strokes=21.0),
        (115e-9, 345e-9, 1150e-9),
    ),
    "static_nonlinearity_amplifier": Effect(
        "static_nonlinearity",
        lambda axis, rail: CompressingAmplifier(axis=axis, rail=rail),
        (26.0, 15.0, 8.2),
    ),
    "hysteretic_stiffness_stribeck": Effect(
        "hysteretic_stiffness",
        lambda axis, share: StribeckGuide(
            axis=axis, share=share, reaches=(1.5e-6, 5e-6), stiction=1.0
        ),
        (0.0105, 0.0315, 0.105),
    ),
    "extra_resonance_amplifier": Effect(
        "extra_resonance",
        lambda axis, hertz: RingingAmplifier(axis=axis, frequency=hertz, damping=0.03),
        (1830.0, 1310.0, 770.0),
    ),
    "uneven_converter": Effect(
        None,
        lambda axis, error: UnevenConverter(axis=axis, weight=3.125e-6, error=error),
        (80e-9, 240e-9, 800e-9),
    ),
    "sliding_sample": Effect(
        None,
        lambda axis, room: SlidingSample(axis=axis, grip=1.0, room=room),
        (40e-9, 120e-9, 400e-9),
    ),
    "glitching_converter": Effect(
        None,
        lambda axis, volt: GlitchingConverter(axis=axis, height=volt, lasting=60e-6),
        (0.062, 0.124, 0.27),
    ),
}
