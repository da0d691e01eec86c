"""A cascade is its effects in order, and backwards its inverses in the opposite order."""

import numpy as np
import paper
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from afm_scan_ros.core.effects.base import Cascade
from afm_scan_ros.core.effects.creep import Creep
from afm_scan_ros.core.effects.hysteresis.everett import BeyondRangeError
from afm_scan_ros.core.effects.hysteresis.preisach import Preisach
from afm_scan_ros.core.effects.vibration import Vibration

PERIOD = 5e-5
AXIS = paper.axis()
HYSTERESIS = Preisach(AXIS.hysteresis.forward)
VIBRATION = Vibration(AXIS.vibration, PERIOD)
CREEP = Creep(AXIS.creep, PERIOD)
CHAIN = Cascade((HYSTERESIS, VIBRATION, CREEP))
HEIGHT = 5.0 * AXIS.vibration.static_gain


def test_apply_passes_the_signal_from_the_first_effect_to_the_last() -> None:
    drive = np.random.default_rng(0).uniform(-4.0, 4.0, 500)
    signal = drive
    for effect in (HYSTERESIS, VIBRATION, CREEP):
        _, signal = effect.apply(effect.at_rest(), signal)
    assert np.array_equal(CHAIN.apply(CHAIN.at_rest(), drive)[1], signal)


def test_invert_is_equation_23() -> None:
    """The creep's inverse first, then vibration's over the whole, then hysteresis's."""
    targets = paper.smooth_target(1, 1500, HEIGHT)
    _, x = CREEP.invert(CREEP.inverse_at_rest(), targets)
    f = VIBRATION.inverse.invert_whole(x)
    _, u = HYSTERESIS.invert(HYSTERESIS.inverse_at_rest(), f)
    state, first = CHAIN.invert(CHAIN.inverse_at_rest(), targets)
    found = np.concatenate((first, CHAIN.finish(state)))
    assert found == pytest.approx(u, abs=1e-5)


@settings(deadline=None, max_examples=20)
@given(samples=st.integers(0, 300), ahead=st.integers(1, 3))
def test_owed_samples_pass_through_every_later_inverse(samples: int, ahead: int) -> None:
    """Several inverses that look ahead owe their sum, and all of it comes."""
    chain = Cascade((VIBRATION,) * ahead)
    state, first = chain.invert(chain.inverse_at_rest(), np.zeros(samples))
    owed = chain.finish(state)
    assert len(first) == max(samples - ahead * VIBRATION.inverse.preview, 0)
    assert len(first) + len(owed) == samples


def test_a_limit_names_the_sample_of_the_block_that_comes_out() -> None:
    """Whoever counts what came out of earlier blocks knows the sample of the scan."""
    targets = np.concatenate((np.zeros(1000), np.full(1000, 2.0 * HEIGHT)))
    state, calm = CHAIN.invert(CHAIN.inverse_at_rest(), targets[:500])
    with pytest.raises(BeyondRangeError) as caught:
        CHAIN.invert(state, targets[500:])
    assert 950 < len(calm) + caught.value.sample < 1050
