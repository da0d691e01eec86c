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
    """A resonance driven by the other axis; the state is that of the resonance."""

    def __init__(
        self, share: float, frequency: float, damping: float, sample_period: float
    ) -> None:
        omega = 2.0 * np.pi * frequency
        model = VibrationModel((omega**2,), (1.0, 2.0 * damping * omega, omega**2))
        self._share = share
        self._resonance = Vibration(model, sample_period)

    def at_rest(self) -> Array:
        """State at rest at zero."""
        return self._resonance.at_rest()

    def apply(self, state: Array, other: Array) -> tuple[Array, Array]:
        """What the other axis' displacement adds, both (n,) in m."""
        after, moved = self._resonance.apply(state, other)
        return after, self._share * moved


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
    """Resonances at the residual's lines, and between."""
    for frequency in (*clues.prominent[:2], 100.0, 300.0, 1000.0):
        yield 0.0, frequency, 0.02


ENTRY = Entry(
    name="cross_coupling",
    equation="x = x0 + share y0, or x = x0 + share w^2 / (s^2 + 2 damping w s + w^2) y0",
    needs="motion of the other axis that is no function of this one's, nor of time alone",
    confusable=("drift", "parameter_shift", "static_nonlinearity"),
    experiment="one_axis",
    remedy="feedforward",
    advice="both axes are decoupled before either is inverted",
    forms=(
        Form("static", (SHARE,), insert_static, starts_static),
        Form(
            "dynamic",
            (
                SHARE,
                Parameter("frequency", "Hz", 5.0, 2e4, 0.01),
                Parameter("damping", "1", 1e-3, 0.7, 1e-5),
            ),
            insert_dynamic,
            starts_dynamic,
        ),
    ),
)
