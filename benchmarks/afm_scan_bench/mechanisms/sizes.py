"""Further mechanisms at three sizes, as large as those of the product's plant files.

A name is that of the effect followed by the mechanism's, or the mechanism's alone where no
catalogued effect describes it. The families are those of the modules beside this one.
"""

from afm_scan_bench.mechanisms.amplifier import (
    BufferedAmplifier,
    CompressingAmplifier,
    RingingAmplifier,
    SelfHeatingAmplifier,
    SingleEndedAmplifier,
    StarvedAmplifier,
    TiredAmplifier,
)
from afm_scan_bench.mechanisms.coupling import SwingingArm, TuggingHose, YawingStage
from afm_scan_bench.mechanisms.creep import DrainingPad, PolymerPad, RelaxingClamp, SolderedJoint
from afm_scan_bench.mechanisms.disturbance import (
    BoilingCryostat,
    ChatteringValve,
    PoppingMount,
    SupplyRipple,
    ThumpingCompressor,
    WornBearing,
)
from afm_scan_bench.mechanisms.drive_circuit import (
    CeramicFilter,
    GlitchingConverter,
    LooseContact,
    ResistiveElectrode,
    SharedGround,
)
from afm_scan_bench.mechanisms.encoder import (
    GhostLight,
    MiscountingEncoder,
    ScratchedPlate,
    UnevenConverter,
)
from afm_scan_bench.mechanisms.friction import (
    PressedBalls,
    RubbingGuide,
    StribeckGuide,
    SuperelasticLeaf,
)
from afm_scan_bench.mechanisms.hysteresis import (
    ActivatedBlocks,
    CracklingDomains,
    HardenedDomains,
    HastenedBlocks,
    ThinningBlocks,
)
from afm_scan_bench.mechanisms.joint import (
    FloodedJoint,
    RoundHole,
    SlidingSample,
    SnappingLeaf,
    SpringyJoint,
)
from afm_scan_bench.mechanisms.product_sizes import CAPACITANCE, EFFECTS, SizedEffect
from afm_scan_bench.mechanisms.sensor_dynamics import (
    AveragingSensor,
    HumEliminator,
    LateDivider,
    LinearPhaseSensor,
    PipelinedSensor,
)
from afm_scan_bench.mechanisms.sensor_gain import (
    BurstingSupply,
    FadingGain,
    FlickeringReference,
    SaturatingSensor,
)
from afm_scan_bench.mechanisms.structure import (
    CrackedLeaf,
    GluedMirror,
    SprungHolder,
    TautCable,
    TouchedStop,
)
from afm_scan_bench.mechanisms.thermal import HeatedRod, RegulatedStage, WarmedPiezo
from afm_scan_ros.simulation.mechanisms.base import Mechanism

AMPLIFIER = {
    "input_lag_buffered": SizedEffect(
        "input_lag",
        lambda axis, slower: BufferedAmplifier(axis=axis, slower=slower, ratio=0.25),
        (32e-6, 94e-6, 320e-6),
    ),
    "slew_limit_tired": SizedEffect(
        "slew_limit",
        lambda axis, ampere: TiredAmplifier(
            axis=axis, current=ampere, resistance=5.0, capacitance=CAPACITANCE
        ),
        (60e-6, 48e-6, 38e-6),
    ),
    "static_nonlinearity_amplifier": SizedEffect(
        "static_nonlinearity",
        lambda axis, rail: CompressingAmplifier(axis=axis, rail=rail),
        (26.0, 15.0, 8.2),
    ),
    "extra_resonance_amplifier": SizedEffect(
        "extra_resonance",
        lambda axis, hertz: RingingAmplifier(axis=axis, frequency=hertz, damping=0.03),
        (1830.0, 1310.0, 770.0),
    ),
    "slew_limit_single_ended": SizedEffect(
        "slew_limit",
        lambda axis, ohm: SingleEndedAmplifier(axis=axis, pull=ohm, capacitance=CAPACITANCE),
        (247e3, 277e3, 380e3),
    ),
    "self_heating_amplifier": SizedEffect(
        None,
        lambda axis, volt: SelfHeatingAmplifier(axis=axis, offset=volt, settling=4e-3),
        (49e-3, 147e-3, 492e-3),
    ),
    "slew_limit_starved": SizedEffect(
        "slew_limit",
        lambda axis, watt: StarvedAmplifier(axis=axis, power=watt, capacitance=CAPACITANCE),
        (90.9e-6, 77.9e-6, 64.6e-6),
    ),
}

DRIVE_CIRCUIT = {
    "cross_coupling_ground": SizedEffect(
        "cross_coupling",
        lambda axis, share: SharedGround(axis=axis, share=share, time_constant=50e-6),
        (3e-3, 9e-3, 30e-3),
    ),
    "glitching_converter": SizedEffect(
        None,
        lambda axis, volt: GlitchingConverter(axis=axis, height=volt, lasting=60e-6),
        (0.062, 0.124, 0.27),
    ),
    "input_lag_electrode": SizedEffect(
        "input_lag",
        lambda axis, ohm: ResistiveElectrode(axis=axis, resistance=ohm, capacitance=CAPACITANCE),
        (510.0, 1500.0, 5100.0),
    ),
    "loose_contact": SizedEffect(
        None,
        lambda axis, opened: LooseContact(axis=axis, opened=opened),
        (40e-6, 72e-6, 130e-6),
    ),
    "input_lag_ceramic": SizedEffect(
        "input_lag",
        lambda axis, ohm: CeramicFilter(axis=axis, resistance=ohm, capacitance=10e-9),
        (1810.0, 5470.0, 18500.0),
    ),
}

HYSTERESIS = {
    "rate_dependent_hysteresis_hastened": SizedEffect(
        "rate_dependent_hysteresis",
        lambda axis, hardening: HastenedBlocks(axis=axis, hardening=hardening),
        (140e-6, 420e-6, 1400e-6),
    ),
    "parameter_shift_domains": SizedEffect(
        "parameter_shift",
        lambda axis, factor: HardenedDomains(axis=axis, factor=factor),
        (1.007, 1.02, 1.07),
    ),
    "rate_dependent_hysteresis_activated": SizedEffect(
        "rate_dependent_hysteresis",
        lambda axis, volt: ActivatedBlocks(axis=axis, activation=volt, slip_speed=20.0),
        (3e-3, 9e-3, 30e-3),
    ),
    "rate_dependent_hysteresis_thinning": SizedEffect(
        "rate_dependent_hysteresis",
        lambda axis, film: ThinningBlocks(axis=axis, film=film),
        (0.315e-6, 2.85e-6, 34e-6),
    ),
    "crackling_domains": SizedEffect(
        None,
        lambda axis, volt: CracklingDomains(axis=axis, amplitude=volt, length=0.4),
        (2.29e-3, 6.86e-3, 22.9e-3),
    ),
}

CREEP = {
    "slow_creep_polymer": SizedEffect(
        "slow_creep",
        lambda axis, share: PolymerPad(axis=axis, share=share, power=0.25),
        (0.01, 0.03, 0.1),
    ),
    "drift_clamp": SizedEffect(
        "drift",
        lambda axis, scale: RelaxingClamp(axis=axis, scale=scale, settling=0.5),
        (310e-9, 930e-9, 3.1e-6),
    ),
    "slow_creep_solder": SizedEffect(
        "slow_creep",
        lambda axis, share: SolderedJoint(axis=axis, share=share, settling=0.3),
        (0.013, 0.039, 0.13),
    ),
    "slow_creep_draining": SizedEffect(
        "slow_creep",
        lambda axis, share: DrainingPad(axis=axis, share=share, draining=0.6),
        (0.0138, 0.0413, 0.138),
    ),
}

THERMAL = {
    "drift_rod": SizedEffect(
        "drift",
        lambda axis, growth: HeatedRod(axis=axis, growth=growth, diffusion_time=400.0),
        (1.8e-6, 5.4e-6, 18e-6),
    ),
    "parameter_shift_warmed": SizedEffect(
        "parameter_shift",
        lambda axis, kelvin: WarmedPiezo(axis=axis, kelvin=kelvin),
        (2.2, 6.7, 22.0),
    ),
    "drift_regulated": SizedEffect(
        "drift",
        lambda axis, growth: RegulatedStage(axis=axis, growth=growth, period=12.0, damping=0.3),
        (300e-9, 900e-9, 3000e-9),
    ),
}

STRUCTURE = {
    "extra_resonance_holder": SizedEffect(
        "extra_resonance",
        lambda axis, hertz: SprungHolder(axis=axis, frequency=hertz, damping=0.02),
        (1400.0, 1100.0, 890.0),
    ),
    "extra_resonance_mirror": SizedEffect(
        "extra_resonance",
        lambda axis, mass: GluedMirror(
            axis=axis, mass_ratio=mass, frequency=650.0, relaxing=0.3, settling=1.5e-3
        ),
        (0.05, 0.15, 0.5),
    ),
    "static_nonlinearity_stop": SizedEffect(
        "static_nonlinearity",
        lambda axis, push: TouchedStop(axis=axis, place=8e-6, push=push),
        (111e-9, 347e-9, 1330e-9),
    ),
    "parameter_shift_cracked": SizedEffect(
        "parameter_shift",
        lambda axis, loss: CrackedLeaf(axis=axis, loss=loss),
        (0.0034, 0.0101, 0.0327),
    ),
    "extra_resonance_cable": SizedEffect(
        "extra_resonance",
        lambda axis, share: TautCable(axis=axis, share=share, frequency=345.0, damping=0.01),
        (6.5e-3, 13.5e-3, 22e-3),
    ),
}

COUPLING = {
    "arc": SizedEffect(
        "cross_coupling",
        lambda axis, radius: SwingingArm(axis=axis, radius=radius),
        (2.2e-3, 0.7e-3, 0.22e-3),
    ),
    "cross_coupling_yaw": SizedEffect(
        "cross_coupling",
        lambda axis, share: YawingStage(axis=axis, share=share, frequency=410.0, damping=0.02),
        (3e-3, 9e-3, 30e-3),
    ),
    "cross_coupling_hose": SizedEffect(
        "cross_coupling",
        lambda axis, share: TuggingHose(axis=axis, share=share, relaxing=0.6),
        (2.38e-3, 7.14e-3, 23.8e-3),
    ),
}

JOINT = {
    "backlash_springy": SizedEffect(
        "backlash",
        lambda axis, gap: SpringyJoint(axis=axis, gap=gap, share=0.1),
        (45e-9, 135e-9, 450e-9),
    ),
    "sliding_sample": SizedEffect(
        None,
        lambda axis, room: SlidingSample(axis=axis, grip=1.0, room=room),
        (40e-9, 120e-9, 400e-9),
    ),
    "backlash_flooded": SizedEffect(
        "backlash",
        lambda axis, gap: FloodedJoint(axis=axis, gap=gap),
        (41e-9, 122e-9, 410e-9),
    ),
    "snapping_leaf": SizedEffect(
        None,
        lambda axis, throw: SnappingLeaf(axis=axis, throw=throw, reach=12e-6),
        (33e-9, 98e-9, 330e-9),
    ),
    "backlash_round_hole": SizedEffect(
        "backlash",
        lambda axis, gap: RoundHole(axis=axis, gap=gap),
        (41e-9, 122e-9, 410e-9),
    ),
}

FRICTION = {
    "hysteretic_stiffness_guide": SizedEffect(
        "hysteretic_stiffness",
        lambda axis, share: RubbingGuide(axis=axis, share=share, reaches=(2e-6, 6e-6)),
        (0.0135, 0.04, 0.135),
    ),
    "hysteretic_stiffness_stribeck": SizedEffect(
        "hysteretic_stiffness",
        lambda axis, share: StribeckGuide(
            axis=axis, share=share, reaches=(1.5e-6, 5e-6), stiction=1.0
        ),
        (0.0105, 0.0315, 0.105),
    ),
    "hysteretic_stiffness_balls": SizedEffect(
        "hysteretic_stiffness",
        lambda axis, share: PressedBalls(axis=axis, share=share, reach=12e-6),
        (0.0062, 0.0186, 0.062),
    ),
    "hysteretic_stiffness_superelastic": SizedEffect(
        "hysteretic_stiffness",
        lambda axis, share: SuperelasticLeaf(axis=axis, share=share, reaches=(2e-6, 5e-6, 11e-6)),
        (9.25e-3, 27.8e-3, 93.5e-3),
    ),
}

DISTURBANCE = {
    "periodic_disturbance_supply": SizedEffect(
        "periodic_disturbance",
        lambda axis, volt: SupplyRipple(axis=axis, amplitude=volt, frequency=100.0),
        (0.018, 0.054, 0.18),
    ),
    "popping": SizedEffect(
        None,
        lambda axis, jump: PoppingMount(axis=axis, jump=jump, dwell=0.02),
        (80e-9, 240e-9, 800e-9),
    ),
    "periodic_disturbance_compressor": SizedEffect(
        "periodic_disturbance",
        lambda axis, knock: ThumpingCompressor(axis=axis, amplitude=knock, strokes=21.0),
        (115e-9, 345e-9, 1150e-9),
    ),
    "periodic_disturbance_bearing": SizedEffect(
        "periodic_disturbance",
        lambda axis, knock: WornBearing(axis=axis, amplitude=knock, shaft=24.3),
        (43e-9, 130e-9, 433e-9),
    ),
    "boiling_cryostat": SizedEffect(
        None,
        lambda axis, knock: BoilingCryostat(axis=axis, amplitude=knock),
        (52e-9, 156e-9, 520e-9),
    ),
    "periodic_disturbance_valve": SizedEffect(
        "periodic_disturbance",
        lambda axis, shaken: ChatteringValve(axis=axis, amplitude=shaken, frequency=37.0),
        (26.4e-9, 79.2e-9, 264e-9),
    ),
}

SENSOR_DYNAMICS = {
    "delay_averaging": SizedEffect(
        "delay",
        lambda axis, window: AveragingSensor(axis=axis, window=window),
        (80e-6, 240e-6, 800e-6),
    ),
    "delay_linear_phase": SizedEffect(
        "delay",
        lambda axis, delay: LinearPhaseSensor(axis=axis, delay=delay),
        (17e-6, 50e-6, 170e-6),
    ),
    "delay_pipelined": SizedEffect(
        "delay",
        lambda axis, clock: PipelinedSensor(axis=axis, clock=clock),
        (4.9e-6, 14.3e-6, 49e-6),
    ),
    "late_divider": SizedEffect(
        None,
        lambda axis, reach: LateDivider(axis=axis, reach=reach, settling=2.7e-3),
        (182e-6, 105e-6, 59e-6),
    ),
    "hum_eliminator": SizedEffect(
        None,
        lambda axis, share: HumEliminator(axis=axis, learning=share),
        (3.5e-3, 10.5e-3, 35e-3),
    ),
}

SENSOR_GAIN = {
    "static_nonlinearity_gauge": SizedEffect(
        "static_nonlinearity",
        lambda axis, reach: SaturatingSensor(axis=axis, reach=reach, offset=5e-6),
        (230e-6, 135e-6, 75e-6),
    ),
    "fading_gain": SizedEffect(
        None,
        lambda axis, loss: FadingGain(axis=axis, loss=loss, settling=2.0),
        (0.009, 0.027, 0.09),
    ),
    "flickering_reference": SizedEffect(
        None,
        lambda axis, noise: FlickeringReference(axis=axis, amplitude=noise),
        (3.6e-3, 10.8e-3, 36e-3),
    ),
    "bursting_supply": SizedEffect(
        None,
        lambda axis, sag: BurstingSupply(axis=axis, sag=sag, bursts=137.0),
        (0.0117, 0.0351, 0.117),
    ),
}

ENCODER = {
    "uneven_converter": SizedEffect(
        None,
        lambda axis, error: UnevenConverter(axis=axis, weight=3.125e-6, error=error),
        (80e-9, 240e-9, 800e-9),
    ),
    "scratched_plate": SizedEffect(
        None,
        lambda axis, depth: ScratchedPlate(axis=axis, depth=depth),
        (138e-9, 414e-9, 1380e-9),
    ),
    "miscounting_encoder": SizedEffect(
        None,
        lambda axis, mark: MiscountingEncoder(axis=axis, mark=mark),
        (33e-9, 98e-9, 330e-9),
    ),
    "ghost_light": SizedEffect(
        None,
        lambda axis, ghost: GhostLight(axis=axis, period=6e-6, ghost=ghost, shaking=83.0),
        (0.0595, 0.178, 0.568),
    ),
}

ALL = {
    **EFFECTS,
    **AMPLIFIER,
    **DRIVE_CIRCUIT,
    **HYSTERESIS,
    **CREEP,
    **THERMAL,
    **STRUCTURE,
    **COUPLING,
    **JOINT,
    **FRICTION,
    **DISTURBANCE,
    **SENSOR_DYNAMICS,
    **SENSOR_GAIN,
    **ENCODER,
}
"""Every effect by its name, those of the product's plant files first."""

PAIRS = (
    ("delay", "drift"),
    ("cross_coupling_tilt", "periodic_disturbance_mains"),
    ("input_lag", "static_nonlinearity_flexure"),
    ("backlash", "slow_creep_logarithmic"),
    ("cross_coupling_mode", "hysteretic_stiffness"),
    ("extra_resonance", "rate_dependent_hysteresis"),
)
"""Effects (of ``EFFECTS``) that a scanner has both of."""


def sized(effect: str, size: str, axis: str) -> tuple[Mechanism, ...]:
    """Mechanisms of an effect (of ``ALL``) at one of the ``SIZES``, on axis "x" or "y"."""
    return ALL[effect].sized(size, axis)
