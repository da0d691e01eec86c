"""Input lag: the voltage on the piezo lags behind the converter's.

τ dv/dt + v = u acts before the hysteresis. τ is in s, u and v are in V. Causes: the amplifier's
output resistance and the piezo's capacitance, or a low-pass filter behind the converter.

The hysteresis takes v as held between updates. So it gets the mean of v over each hold. That is
exact for motion that is slow relative to the sample period T. With e the voltage at a hold's end
and a = e^{-T/τ}:

    v[k] = u[k] + m (e[k-1] - u[k]),    e[k] = u[k] + a (e[k-1] - u[k]),    m = (1 - a) τ / T
"""

import math
from collections.abc import Iterator

import numpy as np

from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.compiled import compiled
from afm_scan_ros.core.effects.amounts import amounts
from afm_scan_ros.core.effects.base import CausalInverse, Element
from afm_scan_ros.core.effects.effect_type import EffectForm, EffectParameter, EffectType, register
from afm_scan_ros.core.effects.residual_features import ResidualFeatures
from afm_scan_ros.core.types import Array

LAG = EffectParameter("lag", "s", 0.0, 5e-2, 1e-7)


def held_lag(lag: float, sample_period: float) -> tuple[float, float]:
    """Shares m and a of an earlier value: in the mean over a hold, and at its end."""
    if lag == 0.0:
        return 0.0, 0.0
    passed = -math.expm1(-sample_period / lag)
    return passed * lag / sample_period, 1.0 - passed


@compiled
def _apply(end: float, mean_share: float, end_share: float, block: Array, result: Array) -> float:
    for k in range(block.size):
        behind = end - block[k]
        result[k] = block[k] + mean_share * behind
        end = block[k] + end_share * behind
    return end


class InputLag(CausalInverse):
    """First-order lag; the state is the voltage at the last hold's end (V).

    From v to u the equations above have a pole p = (a - m) / (1 - m), near -1 for τ well above
    T: stable, but every kink of v would ring at half the sample rate for some τ / T periods. So
    the inverse takes the pole's part, a delay by less than half a sample, as the straight line
    through the last two samples. That is exact up to first order in ωT, and never rings. The
    inverse's state is the last two samples of v (V).
    """

    def __init__(self, lag: float, sample_period: float) -> None:
        self._shares = held_lag(lag, sample_period)
        mean_share, end_share = self._shares
        ahead = (mean_share - end_share) / (1.0 - end_share)  # -p / (1 - p)
        self._inverse = np.convolve([1.0, -end_share], [1.0 + ahead, -ahead]) / (1.0 - end_share)

    def at_rest(self) -> float:
        """Voltage of a scanner that has long rested at zero."""
        return 0.0

    def apply(self, state: float, block: Array) -> tuple[float, Array]:
        """Mean voltage v on the piezo during each hold, for voltages u held, both (n,)."""
        result = np.empty_like(block)
        return _apply(state, *self._shares, block, result), result

    def inverse_at_rest(self) -> Array:
        """Both samples before the first, at rest."""
        return np.zeros(2)

    def invert(self, state: Array, block: Array) -> tuple[Array, Array]:
        """Voltages u to hold for mean voltages v, both (n,)."""
        known = np.concatenate((state, block))
        now, last, before = self._inverse
        return known[-2:].copy(), now * known[2:] + last * known[1:-1] + before * known[:-2]


def insert(chain: Chain, values: Array) -> Chain:
    """Let the drive lag by a time constant in s."""
    return chain.with_drive(Element(InputLag, tuple(values)))


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
