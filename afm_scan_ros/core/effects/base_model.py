"""Descriptions of the effects of the base model: hysteresis, vibration and creep.

They stand here, and not in the modules of these effects, because the chain imports those modules
and a description refers to the chain.
"""

import numpy as np

from afm_scan_ros.core.effects import creep as creep_module
from afm_scan_ros.core.effects import vibration as vibration_module
from afm_scan_ros.core.effects.effect_type import EffectParameter, EffectType, register
from afm_scan_ros.core.effects.hysteresis import duhem, preisach
from afm_scan_ros.core.effects.vibration import LONGEST_DELAY


@register
def creep() -> EffectType:
    """Describe the effect."""
    return EffectType(
        name="creep",
        equation="x = x0 + sum of z_i, time_constants_i dz_i/dt + z_i = gains_i x0",
        needs="steps held as long as the slowest time constant that matters",
        experiment="creep",
        remedy="feedforward",
        advice="the inverse counts from the scan's start: rest as long before it as creep lasts",
        source="D. Croft, G. Shed and S. Devasia, J. Dyn. Syst. Meas. Control 123"
        " (2001) 35, Eqs. 1, 6 and 9.",
        inverse="Each step of the sampled system is solved for its input, so the inverse is exact.",
        parameters=(
            EffectParameter("gains", "1", -np.inf, np.inf),
            EffectParameter("time_constants", "s", 0.0, np.inf),
        ),
        physics=creep_module.__doc__ or "",
    )


@register
def hysteresis() -> EffectType:
    """Describe the effect."""
    return EffectType(
        name="hysteresis",
        equation="F = sum of plays of u, weighted by the Everett surface E(alpha, beta), or dF/du ="
        " rising(u, F) while u grows and falling(u, F) while it falls",
        needs="slow reversal curves over the whole range of the drive",
        experiment="hysteresis",
        remedy="feedforward",
        advice="scan within the range that was identified",
        source="D. Croft, G. Shed and S. Devasia, J. Dyn. Syst. Meas. Control 123"
        " (2001) 35, Eqs. 11 to 17; B. D. Coleman and M. L. Hodgdon, Int. J. Engineering Science 24"
        " (1986) 897.",
        inverse="The exact inverse solves one cell of the surface, or one step of the differential"
        " equation, for each sample. The direct inverse is the paper's: a Preisach model identified"
        " from output to input.",
        parameters=(
            EffectParameter("lower", "V", -np.inf, np.inf),
            EffectParameter("upper", "V", -np.inf, np.inf),
            EffectParameter("offset", "V", -np.inf, np.inf),
            EffectParameter("values", "V", 0.0, np.inf),
        ),
        physics="\n".join((preisach.__doc__ or "", duhem.__doc__ or "")),
    )


@register
def vibration() -> EffectType:
    """Describe the effect."""
    return EffectType(
        name="vibration",
        equation="x = numerator(s) / denominator(s) exp(-s delay) F",
        needs="a drive with power at all frequencies up to some times the first resonance",
        experiment="frequency",
        remedy="feedforward",
        advice="the preview must be as long as the inverse's response to the targets ahead",
        source="D. Croft, G. Shed and S. Devasia, J. Dyn. Syst. Meas. Control 123"
        " (2001) 35, Eqs. 5, 8 and 22.",
        inverse="The optimal inverse of Eq. 22, as a filter that looks ahead by the preview. Its"
        " weight bounds the drive above the corner frequency.",
        parameters=(
            EffectParameter("numerator", "V/V", -np.inf, np.inf),
            EffectParameter("denominator", "1", -np.inf, np.inf),
            EffectParameter("delay", "s", 0.0, LONGEST_DELAY),
        ),
        physics=vibration_module.__doc__ or "",
    )
