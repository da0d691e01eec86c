"""The third to the sixth set of kinds that were kept, all opened: as those of other_sizes.py.

docs/diagnosis.md says when, and what came of it. All may be looked at in tuning since.
"""

from afm_scan_ros.simulation.mechanisms.activated_blocks import ActivatedBlocks
from afm_scan_ros.simulation.mechanisms.boiling_cryostat import BoilingCryostat
from afm_scan_ros.simulation.mechanisms.bursting_supply import BurstingSupply
from afm_scan_ros.simulation.mechanisms.ceramic_filter import CeramicFilter
from afm_scan_ros.simulation.mechanisms.compressing_amplifier import CompressingAmplifier
from afm_scan_ros.simulation.mechanisms.cracked_leaf import CrackedLeaf
from afm_scan_ros.simulation.mechanisms.draining_pad import DrainingPad
from afm_scan_ros.simulation.mechanisms.effect import CAPACITANCE, Effect
from afm_scan_ros.simulation.mechanisms.flickering_reference import FlickeringReference
from afm_scan_ros.simulation.mechanisms.flooded_joint import FloodedJoint
from afm_scan_ros.simulation.mechanisms.glitching_converter import GlitchingConverter
from afm_scan_ros.simulation.mechanisms.glued_mirror import GluedMirror
from afm_scan_ros.simulation.mechanisms.late_divider import LateDivider
from afm_scan_ros.simulation.mechanisms.linear_phase_sensor import LinearPhaseSensor
from afm_scan_ros.simulation.mechanisms.loose_contact import LooseContact
from afm_scan_ros.simulation.mechanisms.miscounting_encoder import MiscountingEncoder
from afm_scan_ros.simulation.mechanisms.pipelined_sensor import PipelinedSensor
from afm_scan_ros.simulation.mechanisms.pressed_balls import PressedBalls
from afm_scan_ros.simulation.mechanisms.regulated_stage import RegulatedStage
from afm_scan_ros.simulation.mechanisms.relaxing_clamp import RelaxingClamp
from afm_scan_ros.simulation.mechanisms.resistive_electrode import ResistiveElectrode
from afm_scan_ros.simulation.mechanisms.ringing_amplifier import RingingAmplifier
from afm_scan_ros.simulation.mechanisms.round_hole import RoundHole
from afm_scan_ros.simulation.mechanisms.scratched_plate import ScratchedPlate
from afm_scan_ros.simulation.mechanisms.self_heating_amplifier import SelfHeatingAmplifier
from afm_scan_ros.simulation.mechanisms.single_ended_amplifier import SingleEndedAmplifier
from afm_scan_ros.simulation.mechanisms.sliding_sample import SlidingSample
from afm_scan_ros.simulation.mechanisms.snapping_leaf import SnappingLeaf
from afm_scan_ros.simulation.mechanisms.soldered_joint import SolderedJoint
from afm_scan_ros.simulation.mechanisms.stribeck_guide import StribeckGuide
from afm_scan_ros.simulation.mechanisms.thinning_blocks import ThinningBlocks
from afm_scan_ros.simulation.mechanisms.thumping_compressor import ThumpingCompressor
from afm_scan_ros.simulation.mechanisms.touched_stop import TouchedStop
from afm_scan_ros.simulation.mechanisms.uneven_converter import UnevenConverter
from afm_scan_ros.simulation.mechanisms.warmed_piezo import WarmedPiezo
from afm_scan_ros.simulation.mechanisms.worn_bearing import WornBearing
from afm_scan_ros.simulation.mechanisms.yawing_stage import YawingStage

THIRD = {
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

FOURTH = {
    "cross_coupling_yaw": Effect(
        "cross_coupling",
        lambda axis, share: YawingStage(axis=axis, share=share, frequency=410.0, damping=0.02),
        (3e-3, 9e-3, 30e-3),
    ),
    "extra_resonance_mirror": Effect(
        "extra_resonance",
        lambda axis, mass: GluedMirror(
            axis=axis, mass_ratio=mass, frequency=650.0, relaxing=0.3, settling=1.5e-3
        ),
        (0.05, 0.15, 0.5),
    ),
    "input_lag_electrode": Effect(
        "input_lag",
        lambda axis, ohm: ResistiveElectrode(axis=axis, resistance=ohm, capacitance=CAPACITANCE),
        (510.0, 1500.0, 5100.0),
    ),
    "slow_creep_solder": Effect(
        "slow_creep",
        lambda axis, share: SolderedJoint(axis=axis, share=share, settling=0.3),
        (0.013, 0.039, 0.13),
    ),
    "slew_limit_single_ended": Effect(
        "slew_limit",
        lambda axis, ohm: SingleEndedAmplifier(axis=axis, pull=ohm, capacitance=CAPACITANCE),
        (247e3, 277e3, 380e3),
    ),
    "parameter_shift_warmed": Effect(
        "parameter_shift",
        lambda axis, kelvin: WarmedPiezo(axis=axis, kelvin=kelvin),
        (2.2, 6.7, 22.0),
    ),
    "backlash_flooded": Effect(
        "backlash",
        lambda axis, gap: FloodedJoint(axis=axis, gap=gap),
        (41e-9, 122e-9, 410e-9),
    ),
    "flickering_reference": Effect(
        None,
        lambda axis, noise: FlickeringReference(axis=axis, amplitude=noise),
        (3.6e-3, 10.8e-3, 36e-3),
    ),
    "loose_contact": Effect(
        None,
        lambda axis, opened: LooseContact(axis=axis, opened=opened),
        (40e-6, 72e-6, 130e-6),
    ),
    "snapping_leaf": Effect(
        None,
        lambda axis, throw: SnappingLeaf(axis=axis, throw=throw, reach=12e-6),
        (33e-9, 98e-9, 330e-9),
    ),
}

FIFTH = {
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

SIXTH = {
    "input_lag_ceramic": Effect(
        "input_lag",
        lambda axis, ohm: CeramicFilter(axis=axis, resistance=ohm, capacitance=10e-9),
        (1810.0, 5470.0, 18500.0),
    ),
    "slow_creep_draining": Effect(
        "slow_creep",
        lambda axis, share: DrainingPad(axis=axis, share=share, draining=0.6),
        (0.0138, 0.0413, 0.138),
    ),
    "backlash_round_hole": Effect(
        "backlash",
        lambda axis, gap: RoundHole(axis=axis, gap=gap),
        (41e-9, 122e-9, 410e-9),
    ),
    "static_nonlinearity_stop": Effect(
        "static_nonlinearity",
        lambda axis, push: TouchedStop(axis=axis, place=8e-6, push=push),
        (111e-9, 347e-9, 1330e-9),
    ),
    "parameter_shift_cracked": Effect(
        "parameter_shift",
        lambda axis, loss: CrackedLeaf(axis=axis, loss=loss),
        (0.0034, 0.0101, 0.0327),
    ),
    "self_heating_amplifier": Effect(
        None,
        lambda axis, volt: SelfHeatingAmplifier(axis=axis, offset=volt, settling=4e-3),
        (49e-3, 147e-3, 492e-3),
    ),
    "scratched_plate": Effect(
        None,
        lambda axis, depth: ScratchedPlate(axis=axis, depth=depth),
        (138e-9, 414e-9, 1380e-9),
    ),
    "miscounting_encoder": Effect(
        None,
        lambda axis, mark: MiscountingEncoder(axis=axis, mark=mark),
        (33e-9, 98e-9, 330e-9),
    ),
}
