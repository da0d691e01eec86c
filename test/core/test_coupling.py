"""What each axis adds to the other, and its removal before either is inverted."""

import numpy as np
import paper
import pytest
from attrs import evolve
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import signal

from afm_scan_ros.core.coupling import Coupling
from afm_scan_ros.core.effects.cross_coupling import DynamicCoupling
from afm_scan_ros.core.model import Added, ScannerModel, VibrationModel
from afm_scan_ros.core.types import Trace

PERIOD = 5e-5
AXIS = paper.axis()


def static(share: float) -> Added:
    return Added("cross_coupling", "static", (share,))


def arc(curvature: float) -> Added:
    return Added("cross_coupling", "arc", (curvature,))


def scanner(to_x: tuple[Added, ...], to_y: tuple[Added, ...]) -> ScannerModel:
    return ScannerModel(evolve(AXIS, added=to_x), evolve(AXIS, added=to_y))


def motion(seed: int, samples: int = 500) -> Trace:
    x, y = (paper.smooth_target(seed + i, samples, 1e-5) for i in range(2))
    return Trace(7, PERIOD, x, y)


def test_shares_of_both_kinds_add_up() -> None:
    """Golden: by hand."""
    coupling = Coupling(scanner((static(0.02), static(0.03)), (static(-0.01),)), PERIOD)
    own = Trace(7, PERIOD, np.array([1.0, 2.0]), np.array([10.0, -10.0]))
    coupled = coupling.apply(coupling.at_rest(), own)[1]
    assert coupled.x == pytest.approx([1.5, 1.5])
    assert coupled.y == pytest.approx([9.99, -10.02])
    assert coupled.first_sample == 7


def test_an_arc_adds_the_same_to_either_side() -> None:
    """Golden: by hand; 10 um out on an arc of 1 mm are 50 nm aside, (10 um)^2 / 2 mm."""
    coupling = Coupling(scanner((arc(1e3),), ()), PERIOD)
    own = Trace(0, PERIOD, np.array([1e-6, 0.0]), np.array([1e-5, -1e-5]))
    coupled = coupling.apply(coupling.at_rest(), own)[1]
    assert coupled.x == pytest.approx([1.05e-6, 5e-8])


def test_nothing_added_adds_nothing() -> None:
    coupling, own = Coupling(scanner((), ()), PERIOD), motion(1)
    for step in (coupling.apply, coupling.invert):
        found = step(coupling.at_rest(), own)[1]
        assert np.array_equal(found.x, own.x)
        assert np.array_equal(found.y, own.y)


def test_an_axis_that_does_not_count_is_left_alone() -> None:
    coupling = Coupling(scanner((static(0.1),), (static(0.1),)), PERIOD, axes=("y",))
    own = motion(2)
    coupled = coupling.apply(coupling.at_rest(), own)[1]
    assert np.array_equal(coupled.x, own.x)
    assert coupled.y == pytest.approx(own.y + 0.1 * own.x)


shares = st.floats(-0.3, 0.3)


@settings(deadline=None, max_examples=30)
@given(
    to_x=shares,
    to_y=shares,
    dynamic=shares,
    curvature=st.floats(-5e3, 5e3),
    seed=st.integers(0, 1000),
)
def test_the_inverse_is_exact_both_ways_at_once(
    to_x: float, to_y: float, dynamic: float, curvature: float, seed: int
) -> None:
    """At the largest shares each round gains a factor of ten."""
    resonance = Added("cross_coupling", "dynamic", (dynamic, 300.0, 0.1))
    coupling = Coupling(scanner((static(to_x), arc(curvature)), (static(to_y), resonance)), PERIOD)
    target = motion(seed)
    own = coupling.invert(coupling.at_rest(), target)[1]
    found = coupling.apply(coupling.at_rest(), own)[1]
    for axis in ("x", "y"):
        assert np.abs(found.axis(axis) - target.axis(axis)).max() <= 1e-5 * 1e-5


@pytest.mark.parametrize("frequency", [40.0, 300.0, 3000.0])
def test_a_structure_between_the_axes_follows_as_driven_between_samples_too(
    frequency: float,
) -> None:
    """Golden: scipy's exact answer to an input that is straight between samples."""
    omega, damping, other = 2.0 * np.pi * frequency, 0.02, motion(3).x
    system = ([omega**2], [1.0, 2.0 * damping * omega, omega**2])
    element = DynamicCoupling(0.05, VibrationModel(*system), PERIOD)
    found = element.apply(element.at_rest(), other)[1]
    expected = 0.05 * signal.lsim(system, other, PERIOD * np.arange(len(other)))[1]
    assert np.abs(found - expected).max() <= 2e-3 * np.abs(expected).max()
