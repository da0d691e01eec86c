"""The nonlinear spring against an independent solution of Duffing's equation."""

import numpy as np
import pytest

from afm_scan_ros.core.effects.nonlinear_spring import NonlinearSpring
from afm_scan_ros.core.effects.vibration import Resonance
from afm_scan_ros.core.errors import ScanError
from helpers.duffing import Oscillator, multisine

PERIOD = 1e-4
LINEAR = Oscillator()
RESONANCE = Resonance(LINEAR.omega, LINEAR.damping, (1.0,))


@pytest.mark.parametrize(("square", "cube"), [(0.0, 4e10), (5e4, 0.0), (-5e4, 4e10)])
def test_it_moves_as_duffings_equation_says(square: float, cube: float) -> None:
    """At 140 samples a period of the resonance."""
    drive = multisine(4000, seed=1, share=0.03)
    straight = LINEAR.moved(drive, PERIOD)
    bent = Oscillator(square=square, cube=cube).moved(drive, PERIOD)
    spring = NonlinearSpring(RESONANCE, square, cube, PERIOD)
    _, moved = spring.apply(spring.at_rest(), straight)
    changed = float(np.std(bent - straight))
    assert changed > 0.05 * np.std(straight)
    assert np.std(moved - bent) < 5e-3 * changed


def test_a_spring_that_turns_back_is_named() -> None:
    spring = NonlinearSpring(RESONANCE, 0.0, -1e12, PERIOD)
    with np.errstate(all="ignore"), pytest.raises(ScanError, match="the spring turns back"):
        spring.apply(spring.at_rest(), np.full(20000, 1e-5))
