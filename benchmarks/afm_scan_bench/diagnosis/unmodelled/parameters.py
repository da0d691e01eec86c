"""Parameters that effect and catalogue have in common: found beside true."""

from collections.abc import Callable, Iterator, Mapping
from typing import Any

from attrs import frozen

from afm_scan_bench.mechanisms.amplifier import SUPPLY
from afm_scan_ros.core.diagnosis.diagnosis import ScannerDiagnosis
from afm_scan_ros.core.diagnosis.result import IdentifiedEffect
from afm_scan_ros.simulation.mechanisms.base import Mechanism
from afm_scan_ros.simulation.mechanisms.environment import FloorVibration

TRUE: Mapping[str, tuple[str, str, Callable[[Any], Mapping[str, float]]]] = {
    "tilted_sensor": ("cross_coupling", "static", lambda m: {"share": m.angle}),
    "swinging_arm": ("cross_coupling", "arc", lambda m: {"curvature": 1.0 / m.radius}),
    "coupled_stage": (
        "cross_coupling",
        "coupled_mode",
        lambda m: {"share": m.share, "frequency": m.frequency, "damping": m.damping},
    ),
    "yawing_stage": (
        "cross_coupling",
        "dynamic",
        lambda m: {"share": m.share, "frequency": m.frequency, "damping": m.damping},
    ),
    "riding_mass": (
        "extra_resonance",
        "absorber_mode",
        lambda m: {"mass": m.mass_ratio, "frequency": m.frequency, "damping": m.damping},
    ),
    "lagging_amplifier": ("input_lag", "", lambda m: {"lag": m.resistance * m.capacitance}),
    "delayed_converter": ("delay", "", lambda m: {"delay": m.delay}),
    "averaging_sensor": ("delay", "", lambda m: {"delay": m.window / 2.0}),
    "linear_phase_sensor": ("delay", "", lambda m: {"delay": m.delay}),
    "limited_amplifier": ("slew_limit", "", lambda m: {"slope": m.current / m.capacitance}),
    "loose_joint": ("backlash", "", lambda m: {"width": 2.0 * m.gap}),
    "heavier_load": (
        "parameter_shift",
        "resonance",
        lambda m: dict.fromkeys(
            ("frequency_factor", "damping_factor"), (1.0 + m.mass_ratio) ** -0.5
        ),
    ),
    "aged_creep": (
        "parameter_shift",
        "creep",
        lambda m: {"gain_factor": m.factor, "time_factor": 1.0},
    ),
    "lost_poling": ("parameter_shift", "gain", lambda m: {"factor": 1.0 - m.loss}),
    "cracked_leaf": (
        "parameter_shift",
        "stiffness",
        lambda m: {"stiffness_factor": 1.0 - m.loss},
    ),
    "warmed_piezo": (
        "parameter_shift",
        "warmth",
        lambda m: {"factor": m.further, "gain_factor": 1.0, "time_factor": 1.0 / m.sooner},
    ),
    "soldered_joint": (
        "slow_creep",
        "power",
        lambda m: {"gain": m.share, "time_constant": m.settling, "power": 3.0},
    ),
    "single_ended_amplifier": (
        "slew_limit",
        "resistive",
        lambda m: {"falling_slope": SUPPLY * m.rate, "rate": m.rate},
    ),
}
"""Name and kind in the catalogue of a mechanism, and its parameters as the catalogue has them.

What is not here is other physics than the catalogue's, with no parameter in common.
"""


@frozen
class ParameterComparison:
    """A parameter of an effect: what was found, half its 95 % interval, and what is true."""

    name: str
    found: float
    halfwidth: float
    true: float

    @property
    def inside(self) -> bool:
        """Whether the interval holds the truth."""
        return abs(self.found - self.true) <= self.halfwidth


def compared(mechanism: Mechanism, found: ScannerDiagnosis) -> Iterator[ParameterComparison]:
    """Compare each parameter that a mechanism has in common with an effect that was found."""
    for effect in found.effects:
        if effect.axis != mechanism.axis:
            continue
        true = _true(mechanism, effect)
        for value in effect.values:
            name = value.parameter.name
            if name in true:
                yield ParameterComparison(
                    f"{effect.name} {name}", value.value, value.halfwidth, true[name]
                )


def _true(mechanism: Mechanism, effect: IdentifiedEffect) -> Mapping[str, float]:
    if isinstance(mechanism, FloorVibration) and effect.name == "periodic_disturbance":
        return _nearest_line(mechanism, effect)
    name, kind, values = TRUE.get(mechanism.KIND, ("", "", dict))
    return values(mechanism) if (effect.name, effect.kind) == (name, kind) else {}


def _nearest_line(floor: FloorVibration, effect: IdentifiedEffect) -> Mapping[str, float]:
    (found,) = (v.value for v in effect.values if v.parameter.name == "frequency")
    lines = [floor.frequency * n for n in range(1, 2 + len(floor.harmonics))]
    return {"frequency": min(lines, key=lambda line: abs(line - found))}
