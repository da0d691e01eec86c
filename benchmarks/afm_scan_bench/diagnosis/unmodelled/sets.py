"""Development and held-out sets of the diagnosis benches.

Thresholds and forms of the diagnosis were chosen on the development set. A held-out set was not
looked at before its figures were published. The formerly held-out sets have been part of the
development set since their figures were published; docs/decisions/held_out_sets.md has these.
"""

from collections.abc import Mapping

from afm_scan_bench.mechanisms.sizes import ALL

DEVELOPMENT_PLANTS = 1
"""First seed of the plants of the development set."""

HELD_OUT_PLANTS = 7000
"""First seed of the held-out plants, with the mechanisms of the product's plant files."""

HELD_OUT_MECHANISM_PLANTS = 7500
"""First seed of the held-out plants with ``HELD_OUT_MECHANISMS``."""

IMAGE_PLANTS = 7800
"""First seed of the held-out plants that are scanned for a whole image."""

HELD_OUT_MECHANISMS = (
    "cross_coupling_hose",
    "extra_resonance_cable",
    "slew_limit_starved",
    "periodic_disturbance_valve",
    "hysteretic_stiffness_superelastic",
    "crackling_domains",
    "ghost_light",
    "hum_eliminator",
)
"""Effects (of ``ALL``) of the held-out set, in the order of its cases."""

FORMERLY_HELD_OUT: Mapping[int, tuple[str, ...]] = {
    2500: (
        "input_lag_buffered",
        "extra_resonance_holder",
        "cross_coupling_ground",
        "slow_creep_polymer",
        "slew_limit_tired",
        "parameter_shift_domains",
        "backlash_springy",
        "fading_gain",
        "arc",
        "popping",
    ),
    3500: (
        "delay_linear_phase",
        "rate_dependent_hysteresis_activated",
        "drift_clamp",
        "periodic_disturbance_compressor",
        "static_nonlinearity_amplifier",
        "hysteretic_stiffness_stribeck",
        "extra_resonance_amplifier",
        "uneven_converter",
        "sliding_sample",
        "glitching_converter",
    ),
    4500: (
        "cross_coupling_yaw",
        "extra_resonance_mirror",
        "input_lag_electrode",
        "slow_creep_solder",
        "slew_limit_single_ended",
        "parameter_shift_warmed",
        "backlash_flooded",
        "flickering_reference",
        "loose_contact",
        "snapping_leaf",
    ),
    5500: (
        "delay_pipelined",
        "rate_dependent_hysteresis_thinning",
        "drift_regulated",
        "periodic_disturbance_bearing",
        "hysteretic_stiffness_balls",
        "bursting_supply",
        "late_divider",
        "boiling_cryostat",
    ),
    6500: (
        "input_lag_ceramic",
        "slow_creep_draining",
        "backlash_round_hole",
        "static_nonlinearity_stop",
        "parameter_shift_cracked",
        "self_heating_amplifier",
        "scratched_plate",
        "miscounting_encoder",
    ),
}
"""Effects (of ``ALL``) of each set that was held out before, by the first seed of its plants."""

DEVELOPMENT_MECHANISMS = tuple(name for name in ALL if name not in HELD_OUT_MECHANISMS)
"""Effects (of ``ALL``) of the development set."""
