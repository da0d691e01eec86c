"""Thermal mechanisms: drift, and a piezo at another temperature."""

from typing import ClassVar

import numpy as np
from attrs import evolve, frozen
from attrs.validators import gt, lt

from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.axis import AxisSpec, RationalSpec, quantity, series, with_series
from afm_scan_ros.simulation.mechanisms.base import Alteration, Clocked, Place

ROD_TERMS = 60


@frozen(kw_only=True)
class HeatedRod(Clocked):
    """A rod between scanner and tip that is heated at one end.

        dT/dt = D d2T/dz2,    T(0) = heating, no heat flows at z = length
        x_out = x + expansion length mean(T)

    The length grows with the square root of time at first and settles as an exponential. Solved by
    the first eigenfunctions, cos((n + 1/2) pi (1 - z / length)). The others are 0.3 % of the growth
    at t = 0, and vanish after 1e-4 of the diffusion time. ``growth`` (m) in the end,
    ``diffusion_time`` length^2 / D (s).
    Source: H. S. Carslaw and J. C. Jaeger, Conduction of Heat in Solids, Oxford 1959, 3.4.
    """

    KIND: ClassVar[str] = "heated_rod"
    PLACE: ClassVar[Place] = "displacement"

    growth: float = quantity(suffix="_um", scale=1e-6)
    diffusion_time: float = quantity(gt(0.0), suffix="_s")

    def drawn(self, rng: np.random.Generator) -> None:
        """Nothing: the heater has just been turned on."""

    def at(self, time: Array, own: Array, drawn: None) -> Array:  # noqa: ARG002
        """Displacement (m) carried along by the rod."""
        warm = np.ones(own.size)
        for n in range(ROD_TERMS):
            root = (n + 0.5) * np.pi
            warm -= 2.0 / root**2 * np.exp(-(root**2) * time / self.diffusion_time)
        return own + self.growth * warm


@frozen(kw_only=True)
class RegulatedStage(Clocked):
    """A stage whose temperature controller overshoots after a change of its set point.

        capacity T' = proportional (set - T) + integral (the sum of set - T over time)
        hence    T'' + 2 d w T' + w^2 T = 2 d w set' + w^2 set
        x_out = x + growth (T / set)

    The set point changes at the beginning of the scan. The thermal expansion moves the sample,
    which overshoots and returns: a drift that reverses. ``growth`` (m) in the end; ``period`` (s)
    and ``damping`` ratio of the controller's oscillation.
    Source: K. J. Astrom, R. M. Murray, Feedback Systems, Princeton 2008, 10.
    """

    KIND: ClassVar[str] = "regulated_stage"
    PLACE: ClassVar[Place] = "displacement"

    growth: float = quantity(suffix="_nm", scale=1e-9)
    period: float = quantity(gt(0.0), suffix="_s")
    damping: float = quantity(gt(0.0), lt(1.0))

    def drawn(self, rng: np.random.Generator) -> None:
        """Nothing: it has just been set."""

    def at(self, time: Array, own: Array, drawn: None) -> Array:  # noqa: ARG002
        """Displacement (m) carried along by the stage."""
        natural, root = 2.0 * np.pi / self.period, np.sqrt(1.0 - self.damping**2)
        turned = natural * root * time
        swing = np.cos(turned) - self.damping / root * np.sin(turned)
        settled: Array = 1.0 - np.exp(-self.damping * natural * time) * swing
        return own + self.growth * settled


ROOM = 295.0  # K
ACTIVATION = 0.6 / 8.617e-5  # K: 0.6 eV over Boltzmann's constant
SOFTENING = 1.5e-3  # 1/K


@frozen(kw_only=True)
class WarmedPiezo(Alteration):
    """A piezo that is warmer than when identified: it moves further and creeps faster.

        d' = (1 + SOFTENING kelvin) d,    1 / tau' = e^(ACTIVATION / k (1 / ROOM - 1 / T)) / tau

    The walls move more easily, and creep is thermally activated (Arrhenius). The temperature is
    constant during a scan: a shift of parameters. ACTIVATION is that of creeping walls in a soft
    ceramic, SOFTENING a manufacturer's value; both are rounded. ``kelvin`` above the temperature at
    which the scanner was identified.
    """

    KIND: ClassVar[str] = "warmed_piezo"

    kelvin: float = quantity(gt(-ROOM), suffix="_k")

    @property
    def further(self) -> float:
        """Factor of all displacement."""
        return 1.0 + SOFTENING * self.kelvin

    @property
    def sooner(self) -> float:
        """Factor of all rates of creep."""
        return float(np.exp(ACTIVATION * (1.0 / ROOM - 1.0 / (ROOM + self.kelvin))))

    def altered(self, axis: AxisSpec) -> AxisSpec:
        """Move further by the softer domains, creep sooner by the warmer ones."""
        whole, (gains, taus) = axis.vibration, series(axis.creep)
        numerator = tuple(self.further * each for each in whole.numerator)
        creep = with_series(axis.creep, gains, taus / self.sooner)
        return evolve(axis, vibration=RationalSpec(numerator, whole.denominator), creep=creep)
