"""Effects by still other physics, as large as those of sizes.py; three of them in no catalogue.

A name is that of the effect, and the mechanism's. Sizes were set by what a mechanism adds to the
true displacement alone. Whether they have been looked at in tuning, docs/diagnosis.md says.
"""

from afm_scan_ros.simulation.mechanisms.chattering_valve import ChatteringValve
from afm_scan_ros.simulation.mechanisms.crackling_domains import CracklingDomains
from afm_scan_ros.simulation.mechanisms.effect import CAPACITANCE, Effect
from afm_scan_ros.simulation.mechanisms.ghost_light import GhostLight
from afm_scan_ros.simulation.mechanisms.hum_eliminator import HumEliminator
from afm_scan_ros.simulation.mechanisms.starved_amplifier import StarvedAmplifier
from afm_scan_ros.simulation.mechanisms.superelastic_leaf import SuperelasticLeaf
from afm_scan_ros.simulation.mechanisms.taut_cable import TautCable
from afm_scan_ros.simulation.mechanisms.tugging_hose import TuggingHose

SEVENTH = {
    "cross_coupling_hose": Effect(
        "cross_coupling",
        lambda axis, share: TuggingHose(axis=axis, share=share, relaxing=0.6),
        (2.38e-3, 7.14e-3, 23.8e-3),
    ),
    "extra_resonance_cable": Effect(
        "extra_resonance",
        lambda axis, share: TautCable(axis=axis, share=share, frequency=345.0, damping=0.01),
        (6.5e-3, 13.5e-3, 22e-3),
    ),
    "slew_limit_starved": Effect(
        "slew_limit",
        lambda axis, watt: StarvedAmplifier(axis=axis, power=watt, capacitance=CAPACITANCE),
        (90.9e-6, 77.9e-6, 64.6e-6),
    ),
    "periodic_disturbance_valve": Effect(
        "periodic_disturbance",
        lambda axis, shaken: ChatteringValve(axis=axis, amplitude=shaken, frequency=37.0),
        (26.4e-9, 79.2e-9, 264e-9),
    ),
    "hysteretic_stiffness_superelastic": Effect(
        "hysteretic_stiffness",
        lambda axis, share: SuperelasticLeaf(axis=axis, share=share, reaches=(2e-6, 5e-6, 11e-6)),
        (9.25e-3, 27.8e-3, 93.5e-3),
    ),
    "crackling_domains": Effect(
        None,
        lambda axis, volt: CracklingDomains(axis=axis, amplitude=volt, length=0.4),
        (2.29e-3, 6.86e-3, 22.9e-3),
    ),
    "ghost_light": Effect(
        None,
        lambda axis, ghost: GhostLight(axis=axis, period=6e-6, ghost=ghost, shaking=83.0),
        (0.0595, 0.178, 0.568),
    ),
    "hum_eliminator": Effect(
        None,
        lambda axis, share: HumEliminator(axis=axis, learning=share),
        (3.5e-3, 10.5e-3, 35e-3),
    ),
}
