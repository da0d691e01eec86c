"""Input lag: the voltage on the piezo lags behind the converter's.

τ dv/dt + v = u before the hysteresis, with u and v in V and τ in seconds. Its cause is the output
resistance of the amplifier and the piezo's capacitance, or a low-pass filter behind the converter.

The hysteresis takes v as held between updates. So it gets the mean of v over each hold, as of
lti.py, with the pole -1/τ. This is exact for all that is slow beside the sample period.
"""

from collections.abc import Iterator

import numpy as np

from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.effects.base import Element
from afm_scan_ros.core.effects.effect_type import EffectForm, EffectParameter, EffectType, register
from afm_scan_ros.core.effects.lti import HeldDrive, pole_of
from afm_scan_ros.core.effects.residual_features import ResidualFeatures, amounts
from afm_scan_ros.core.types import Array

LAG = EffectParameter("lag", "s", 0.0, 5e-2, 1e-7)


def lagging_drive(lag: float, sample_period: float) -> HeldDrive:
    """Return a lag of a time constant (s) at a sample period (s)."""
    return HeldDrive(pole_of(lag), sample_period)


def insert(chain: Chain, values: Array) -> Chain:
    """Let the drive lag by a time constant in s."""
    return chain.with_drive(Element(lagging_drive, tuple(values)))


def starts(features: ResidualFeatures) -> Iterator[tuple[float]]:
    """Lag by which the residual follows the speed, and a lag that only slow motion shows."""
    speed = np.gradient(features.displacement, features.sample_period)
    yield (LAG.nearest(max(-amounts(features.residual, speed)[0], features.sample_period)),)
    yield (20.0 * features.sample_period,)


@register
def input_lag() -> EffectType:
    """Describe the effect."""
    return EffectType(
        name="input_lag",
        equation="lag dv/dt + v = u",
        needs="motion at rates so different that the lag attenuates one more than the other",
        experiment="dither",
        remedy="feedforward",
        advice="the drive is steeper by the lag times its slope: keep it within the amplifier's"
        " limits",
        source="A first-order low pass, sampled behind a zero-order hold: K. J. Åström and"
        " B. Wittenmark, Computer-Controlled Systems, 3rd ed., Prentice Hall 1997.",
        inverse="The exact inverse of the sampled lag has a pole near -1 and would ring at half the"
        " sample rate after every kink. The inverse used replaces that pole by the straight line"
        " through two samples: exact to first order in ωT, and without ringing.",
        confusable=("parameter_shift", "rate_dependent_hysteresis", "slew_limit"),
        forms=(EffectForm("", ("drive",), (LAG,), insert, starts, example=(3e-4,)),),
    )
