"""Cross coupling: one axis moves with the other.

Equations: x = x₀ + c y₀ (static: a rotation or a tilt of the axes or of the sensors), or
x = x₀ + c ω² / (s² + 2 ζ ω s + ω²) y₀ (dynamic: a structure between them, of its own resonance),
y₀ being what the other axis does of itself. c and ζ are dimensionless, ω = 2π f.
"""

from collections.abc import Iterator

import numpy as np
from attrs import evolve, frozen

from afm_scan_ros.core.catalogue.entry import Entry, Form, Parameter
from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.effects.vibration import Vibration, VibrationModel
from afm_scan_ros.core.tracing.clues import Clues
from afm_scan_ros.core.types import Array

SHARE = Parameter("share", "1", -0.3, 0.3, 1e-6)
FREQUENCY = Parameter("frequency", "Hz", 5.0, 2e4, 0.01)
DAMPING = Parameter("damping", "1", 1e-3, 0.7, 1e-5)


@frozen
class StaticCoupling:
    """A share of the other axis; nothing is remembered, so the state is None."""

    share: float

    def at_rest(self) -> None:
        """Return no state."""

    def apply(self, state: None, other: Array) -> tuple[None, Array]:  # noqa: ARG002 - the protocol's
        """What the other axis' displacement adds, both (n,) in m."""
        return None, self.share * other


class DynamicCoupling:
    """A resonance driven by the other axis; the state is its own, and the last sample taken.

    Between samples the other axis is taken to move straight, so each period drives the resonance
    by the mean of its two ends.
    """

    def __init__(
        self, share: float, frequency: float, damping: float, sample_period: float
    ) -> None:
        omega = 2.0 * np.pi * frequency
        model = VibrationModel((omega**2,), (1.0, 2.0 * damping * omega, omega**2))
        self._share = share
        self._resonance = Vibration(model, sample_period)

    def at_rest(self) -> tuple[Array, Array]:
        """State at rest at zero."""
        return self._resonance.at_rest(), np.zeros(1)

    def apply(self, state: tuple[Array, Array], other: Array) -> tuple[tuple[Array, Array], Array]:
        """What the other axis' displacement adds, both (n,) in m."""
        resonance, last = state
        ends = np.concatenate((last, other))
        after, moved = self._resonance.apply(resonance, 0.5 * (ends[1:] + ends[:-1]))
        # Each sample is that at its period's end: one later than the resonance gives it.
        late = self._resonance.apply(after, np.zeros(1))[1]
        return (after, ends[-1:]), self._share * np.concatenate((moved, late))[1:]


def insert_static(chain: Chain, values: Array) -> Chain:
    """Add a share of the other axis."""
    (share,) = values
    return evolve(chain, coupling=(*chain.coupling, lambda _: StaticCoupling(share)))


def insert_dynamic(chain: Chain, values: Array) -> Chain:
    """Add a resonance driven by the other axis: share, frequency (Hz), damping."""
    share, frequency, damping = values
    return evolve(
        chain,
        coupling=(*chain.coupling, lambda t: DynamicCoupling(share, frequency, damping, t)),
    )


def starts_static(_: Clues) -> Iterator[tuple[float]]:
    """No coupling: the share acts linearly."""
    yield (0.0,)


def starts_dynamic(clues: Clues) -> Iterator[tuple[float, float, float]]:
    """Resonances at the residual's lines, and where they often lie."""
    for frequency in (*clues.prominent[:3], 100.0, 300.0, 1000.0):
        yield 1e-3, FREQUENCY.nearest(frequency), 0.02


ENTRY = Entry(
    name="cross_coupling",
    equation="x = x0 + share y0, or x = x0 + share w^2 / (s^2 + 2 damping w s + w^2) y0",
    needs="motion of the other axis that is no function of this one's, nor of time alone",
    confusable=("drift", "extra_resonance", "parameter_shift", "static_nonlinearity"),
    experiment="one_axis",
    remedy="feedforward",
    advice="both axes are decoupled before either is inverted",
    forms=(
        Form("static", (SHARE,), insert_static, starts_static, (0.0,)),
        Form(
            "dynamic",
            (SHARE, FREQUENCY, DAMPING),
            insert_dynamic,
            starts_dynamic,
            (0.0, 300.0, 0.02),
        ),
    ),
)
