"""Effects by physics that nobody looked at while diagnosis was made, and three in no catalogue.

A name is that of the effect, and the mechanism's. Sizes were set by what a mechanism adds to the
true displacement alone; nothing was traced before they were opened (docs/diagnosis.md says when).
"""

from afm_scan_ros.simulation.mechanisms.buffered_amplifier import BufferedAmplifier
from afm_scan_ros.simulation.mechanisms.effect import Effect
from afm_scan_ros.simulation.mechanisms.fading_gain import FadingGain
from afm_scan_ros.simulation.mechanisms.hardened_domains import HardenedDomains
from afm_scan_ros.simulation.mechanisms.polymer_pad import PolymerPad
from afm_scan_ros.simulation.mechanisms.popping_mount import PoppingMount
from afm_scan_ros.simulation.mechanisms.shared_ground import SharedGround
from afm_scan_ros.simulation.mechanisms.springy_joint import SpringyJoint
from afm_scan_ros.simulation.mechanisms.sprung_holder import SprungHolder
from afm_scan_ros.simulation.mechanisms.swinging_arm import SwingingArm
from afm_scan_ros.simulation.mechanisms.tired_amplifier import TiredAmplifier

CAPACITANCE = 100e-9  # F, of the piezo

KEPT_KINDS = {
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
        None,
        lambda axis, radius: SwingingArm(axis=axis, radius=radius),
        (2.2e-3, 0.7e-3, 0.22e-3),
    ),
    "popping": Effect(
        None,
        lambda axis, jump: PoppingMount(axis=axis, jump=jump, dwell=0.02),
        (80e-9, 240e-9, 800e-9),
    ),
}
