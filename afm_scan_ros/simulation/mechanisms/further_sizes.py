"""Effects by further physics, as large as those of sizes.py; three of them in no catalogue.

A name is that of the effect, and the mechanism's. Sizes were set by what a mechanism adds to the
true displacement alone. Whether they have been looked at in tuning, docs/diagnosis.md says.
"""

from afm_scan_ros.simulation.mechanisms.effect import Effect
from afm_scan_ros.simulation.mechanisms.flickering_reference import FlickeringReference
from afm_scan_ros.simulation.mechanisms.flooded_joint import FloodedJoint
from afm_scan_ros.simulation.mechanisms.glued_mirror import GluedMirror
from afm_scan_ros.simulation.mechanisms.loose_contact import LooseContact
from afm_scan_ros.simulation.mechanisms.resistive_electrode import ResistiveElectrode
from afm_scan_ros.simulation.mechanisms.single_ended_amplifier import SingleEndedAmplifier
from afm_scan_ros.simulation.mechanisms.snapping_leaf import SnappingLeaf
from afm_scan_ros.simulation.mechanisms.soldered_joint import SolderedJoint
from afm_scan_ros.simulation.mechanisms.warmed_piezo import WarmedPiezo
from afm_scan_ros.simulation.mechanisms.yawing_stage import YawingStage

CAPACITANCE = 100e-9  # F, of the piezo

FURTHER = {
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
