"""Delay: the displacement comes later than the converter's update explains.

x(t) = x₀(t - τ), with τ in s. The hysteresis does not depend on rate, so a delay before it and one
behind it are the same. Causes: a converter's pipeline, a controller's buffer, a sensor's filter of
linear phase.
"""

from collections.abc import Iterator

import numpy as np

from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.effects.effect_type import EffectForm, EffectParameter, EffectType, register
from afm_scan_ros.core.effects.residual_features import ResidualFeatures, amounts
from afm_scan_ros.core.types import Array

DELAY = EffectParameter("delay", "s", 0.0, 5e-3, 1e-7)


def insert(chain: Chain, values: Array) -> Chain:
    """Delay the vibration by a time in s."""
    return chain.with_vibration(delay=chain.model.vibration.delay + values[0])


def starts(features: ResidualFeatures) -> Iterator[tuple[float]]:
    """Delay by which the residual follows the speed, or two samples."""
    speed = np.gradient(features.displacement, features.sample_period)
    yield (DELAY.nearest(-amounts(features.residual, speed)[0]),)
    yield (2.0 * features.sample_period,)


@register
def delay() -> EffectType:
    """Describe the effect."""
    return EffectType(
        name="delay",
        equation="x(t) = x0(t - delay)",
        needs="motion up to frequencies whose period is not long beside the delay",
        experiment="dither",
        remedy="feedforward",
        advice="the inverse looks further ahead: its preview must exceed the delay",
        source="Sampling of a system with a time delay: K. J. Åström and B. Wittenmark,"
        " Computer-Controlled Systems, 3rd ed., Prentice Hall 1997.",
        inverse="The optimal inverse of the vibration includes the delay.",
        confusable=("input_lag", "parameter_shift", "rate_dependent_hysteresis"),
        forms=(EffectForm("", ("vibration",), (DELAY,), insert, starts, example=(1.3e-4,)),),
    )
