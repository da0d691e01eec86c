"""Effects by yet other physics, as large as those of sizes.py; three of them in no catalogue.

A name is that of the effect, and the mechanism's. Sizes were set by what a mechanism adds to the
true displacement alone. Whether they have been looked at in tuning, docs/diagnosis.md says.
"""

from afm_scan_ros.simulation.mechanisms.ceramic_filter import CeramicFilter
from afm_scan_ros.simulation.mechanisms.cracked_leaf import CrackedLeaf
from afm_scan_ros.simulation.mechanisms.draining_pad import DrainingPad
from afm_scan_ros.simulation.mechanisms.effect import Effect
from afm_scan_ros.simulation.mechanisms.miscounting_encoder import MiscountingEncoder
from afm_scan_ros.simulation.mechanisms.round_hole import RoundHole
from afm_scan_ros.simulation.mechanisms.scratched_plate import ScratchedPlate
from afm_scan_ros.simulation.mechanisms.self_heating_amplifier import SelfHeatingAmplifier
from afm_scan_ros.simulation.mechanisms.touched_stop import TouchedStop

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
