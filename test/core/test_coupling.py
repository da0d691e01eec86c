"""What each axis adds to the other, and its removal before either is inverted."""

from collections.abc import Iterable

import numpy as np
import paper
import pytest
from attrs import evolve
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import signal

from afm_scan_ros.core.effects.cross_coupling import by_structure
from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.model import Added, ScannerModel, VibrationModel
from afm_scan_ros.core.scanner import Coupling
from afm_scan_ros.core.types import Trace

PERIOD = 5e-5
AXIS = paper.axis()


def static(share: float) -> Added:
    return Added("cross_coupling", "static", (share,))


def arc(curvature: float) -> Added:
    return Added("cross_coupling", "arc", (curvature,))


def resonant(share: float, frequency: float = 300.0, damping: float = 0.02) -> Added:
    return Added("cross_coupling", "dynamic", (share, frequency, damping))


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
curvatures = st.floats(-5e3, 5e3)
seeds = st.integers(0, 1000)


def solved(coupling: Coupling, target: Trace, cut: Iterable[int] = ()) -> Trace:
    """Return what each axis is to do of itself, the target being cut into blocks."""
    state, parts = coupling.inverse_at_rest(), []
    for x, y in zip(np.split(target.x, sorted(cut)), np.split(target.y, sorted(cut)), strict=True):
        state, own = coupling.invert(state, Trace(7, target.sample_period, x, y))
        parts.append(own)
    x, y = (np.concatenate([part.axis(axis) for part in parts]) for axis in ("x", "y"))
    return Trace(7, target.sample_period, x, y)


def missed(coupling: Coupling, target: Trace) -> float:
    """Return by how much (m) the model of the inverse's own motion misses the target."""
    found = coupling.apply(coupling.at_rest(), solved(coupling, target))[1]
    return max(np.abs(found.axis(axis) - target.axis(axis)).max() for axis in ("x", "y"))


def raster(samples: int) -> Trace:
    """X to and fro 5 times a second over 16 um, y up over the same."""
    place = 5.0 * PERIOD * np.arange(samples)
    return Trace(7, PERIOD, 8e-6 * signal.sawtooth(2.0 * np.pi * place, 0.5), 1e-6 * place)


@settings(deadline=None, max_examples=30)
@given(to_x=shares, to_y=shares, dynamic=shares, bent=curvatures, seed=seeds)
def test_the_inverse_is_exact_both_ways_at_once(
    to_x: float, to_y: float, dynamic: float, bent: float, seed: int
) -> None:
    resonance = Added("cross_coupling", "dynamic", (dynamic, 300.0, 0.1))
    model = scanner((static(to_x), arc(bent)), (static(to_y), resonance))
    assert missed(Coupling(model, PERIOD), motion(seed)) <= 1e-19


def test_resonances_on_both_axes_are_undone_for_a_whole_raster() -> None:
    """They amplify: 0.05 by 25 at 300 Hz, so that to correct each by the other in turn diverges."""
    coupling = Coupling(scanner((resonant(0.05),), (resonant(0.05),)), PERIOD)
    assert missed(coupling, raster(32_768)) <= 1e-18


sharp = st.tuples(st.floats(0.0, 0.3), st.floats(50.0, 3000.0), st.floats(1e-3, 0.5))


@settings(deadline=None, max_examples=50)
@given(
    to_x=sharp,
    to_y=sharp,
    bent=curvatures,
    seed=seeds,
    cut=st.sets(st.integers(0, 500), max_size=5),
)
def test_blocks_change_nothing_with_resonances_on_both_axes(
    to_x: tuple[float, ...],
    to_y: tuple[float, ...],
    bent: float,
    seed: int,
    cut: set[int],
) -> None:
    """Each resonance by itself would be stable; so are both, or they are refused."""
    model = scanner((resonant(*to_x), arc(bent)), (resonant(*to_y), static(0.1)))
    coupling, target = Coupling(model, PERIOD), motion(seed)
    try:
        whole = solved(coupling, target)
    except InputError:
        return
    parts = solved(coupling, target, cut)
    assert np.array_equal(parts.x, whole.x)
    assert np.array_equal(parts.y, whole.y)
    assert missed(coupling, target) <= 1e-12 * np.abs([whole.x, whole.y]).max() + 1e-20


@settings(deadline=None, max_examples=50)
@given(share=st.floats(0.01, 0.3), frequency=st.floats(50.0, 1000.0), ratio=st.floats(0.1, 10.0))
def test_an_inverse_that_grows_is_refused(share: float, frequency: float, ratio: float) -> None:
    """Of modes w alike and shares s and -s, 1 + s^2 w^4 / q^2 is zero where q = +-j s w^2.

    By hand: s = j w sqrt(1 - zeta^2 -+ j share) - zeta w grows where the root's part exceeds zeta.
    """
    grows = abs(np.sqrt(1.0 - 1j * share).imag)
    damping = ratio * grows
    if abs(ratio - 1.0) < 0.1:
        return
    added = tuple((resonant(s, frequency, damping),) for s in (share, -share))
    coupling = Coupling(scanner(*added), 1e-5)
    if ratio > 1.0:
        assert missed(coupling, motion(3)) <= 1e-18
        return
    with pytest.raises(InputError, match=r"unstable; at .* remove cross_coupling from one axis"):
        coupling.inverse_at_rest()


def test_shares_that_leave_no_inverse_are_refused() -> None:
    many = (static(0.3),) * 4
    with pytest.raises(InputError, match=r"shares of 1.2 and 1.2 .* below 1"):
        Coupling(scanner(many, many), PERIOD).inverse_at_rest()
    opposite = (static(-0.3),) * 4
    assert missed(Coupling(scanner(many, opposite), PERIOD), motion(5)) <= 1e-19


@pytest.mark.parametrize("cut", [[], [100], [1, 199]])
@pytest.mark.parametrize("far", [-300e-6, 300e-6, np.nan])
def test_a_target_that_no_motion_reaches_is_named_with_its_sample(
    far: float, cut: list[int]
) -> None:
    """On an arc of 1 / 5 mm, 200 um aside add as much as they move: none is farther out."""
    coupling = Coupling(scanner((arc(5e3),), (arc(5e3),)), PERIOD)
    near = np.zeros(200)
    aside = np.where(np.arange(200) == 150, far, 0.0)
    with pytest.raises(ScanError, match=r"^sample 150: at x = .* um, y = .* has no inverse"):
        solved(coupling, Trace(7, PERIOD, near + aside, near + aside), cut)


def test_equations_that_rounding_leaves_unsolved_are_refused() -> None:
    """The product of the shares is below 1 by little more than a rounding error."""
    nearly = (static(0.25), static(0.25), static(0.25), static(0.25 - 2e-15))
    coupling = Coupling(scanner((static(0.25),) * 4, nearly), PERIOD)
    with pytest.raises(ScanError, match=r"^sample \d+: at x = .* has no inverse"):
        solved(coupling, motion(8))


def test_a_structure_with_a_delay_is_refused() -> None:
    with pytest.raises(InputError, match="delay"):
        by_structure(0.05, VibrationModel([1e6], [1.0, 100.0, 1e6], 1e-4), PERIOD)


@pytest.mark.parametrize("frequency", [40.0, 300.0, 3000.0])
def test_a_structure_between_the_axes_follows_as_driven_between_samples_too(
    frequency: float,
) -> None:
    """Golden: scipy's exact answer to an input that is straight between samples."""
    omega, damping, other = 2.0 * np.pi * frequency, 0.02, motion(3).x
    system = ([omega**2], [1.0, 2.0 * damping * omega, omega**2])
    element = by_structure(0.05, VibrationModel(*system), PERIOD)
    found = element.apply(element.at_rest(), other)[1]
    expected = 0.05 * signal.lsim(system, other, PERIOD * np.arange(len(other)))[1]
    assert np.abs(found - expected).max() <= 2e-3 * np.abs(expected).max()
