"""Effects by physics that nobody looked at while diagnosis was made, and three in no catalogue.

A name is that of the effect, and the mechanism's. Sizes were set by what a mechanism adds to the
true displacement alone; nothing was traced before they were opened (docs/diagnosis.md says when).
They replace a set that was opened before, which is in other_sizes.py now.
"""

from afm_scan_ros.simulation.mechanisms.activated_blocks import ActivatedBlocks
from afm_scan_ros.simulation.mechanisms.compressing_amplifier import CompressingAmplifier
from afm_scan_ros.simulation.mechanisms.effect import Effect
from afm_scan_ros.simulation.mechanisms.glitching_converter import GlitchingConverter
from afm_scan_ros.simulation.mechanisms.linear_phase_sensor import LinearPhaseSensor
from afm_scan_ros.simulation.mechanisms.relaxing_clamp import RelaxingClamp
from afm_scan_ros.simulation.mechanisms.ringing_amplifier import RingingAmplifier
from afm_scan_ros.simulation.mechanisms.sliding_sample import SlidingSample
from afm_scan_ros.simulation.mechanisms.stribeck_guide import StribeckGuide
from afm_scan_ros.simulation.mechanisms.thumping_compressor import ThumpingCompressor
from afm_scan_ros.simulation.mechanisms.uneven_converter import UnevenConverter

KEPT_KINDS = {
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
