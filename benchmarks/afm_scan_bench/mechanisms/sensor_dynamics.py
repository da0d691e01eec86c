"""Mechanisms of the displacement sensor that depend on the past: filters, delays, echoes."""

from typing import ClassVar

import numpy as np
from attrs import frozen
from attrs.validators import ge, gt, lt

from afm_scan_bench.mechanisms.linear import Stepping
from afm_scan_ros.core.compiled import compiled
from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.axis import ComplexArray, RationalSpec, fractions, quantity
from afm_scan_ros.simulation.mechanisms.base import Insert, Place


@frozen(kw_only=True)
class AveragingSensor(Insert):
    """A sensor whose filter averages over a time window.

        x_read(t) = (1 / window) integral of x over the last window

    The weights are symmetric, so that every slow motion is read half a window late. ``window`` in
    s. State: the displacements of the last window and one before, m.
    """

    KIND: ClassVar[str] = "averaging_sensor"
    PLACE: ClassVar[Place] = "displacement"

    window: float = quantity(gt(0.0), suffix="_us", scale=1e-6)

    def at_rest(self, step: float, rng: np.random.Generator) -> Array:  # noqa: ARG002
        """It has seen the scanner at rest."""
        return np.zeros(int(np.ceil(self.window / step)) + 1)

    def act(self, state: Array, own: Array, other: Array, step: float) -> tuple[Array, Array]:  # noqa: ARG002
        """Displacement (m) averaged; between two instants it runs straight."""
        seen, weights = np.concatenate((state, own)), _weights(self.window / step)
        read = np.zeros_like(own)
        for back, weight in enumerate(weights):
            read += weight * seen[state.size - back : seen.size - back]
        return seen[own.size :], read


def _weights(steps: float) -> Array:
    """Weights of the latest instants in the mean over ``steps`` of what runs straight between."""
    whole, weights = int(steps), np.zeros(int(np.ceil(steps)) + 1)
    weights[:whole] += 0.5
    weights[1 : whole + 1] += 0.5
    part = steps - whole
    if part > 0.0:
        weights[whole] += part * (1.0 - 0.5 * part)
        weights[whole + 1] += 0.5 * part**2
    return weights / steps


PIPELINE_LATENCY = 3


@frozen(kw_only=True)
class PipelinedSensor(Insert):
    """A sensor whose converter has its own clock and a latency of several clock periods.

        x_read(t) = x(tick - LATENCY clock),    tick = the last one of its clock at or before t

    LATENCY is PIPELINE_LATENCY, the number of the converter's pipeline stages. A reading between
    two ticks is the older one. The mean delay is LATENCY + 1/2 clock periods at every rate, with a
    jitter of half a period. Exact for a displacement that is linear within a step. ``clock``:
    period in s.

    State: elapsed steps, the initial phase of the clock (1), displacements since, m.
    Source: W. Kester (ed.), The Data Conversion Handbook, Elsevier 2005, 3.2.
    """

    KIND: ClassVar[str] = "pipelined_sensor"
    PLACE: ClassVar[Place] = "displacement"

    clock: float = quantity(gt(0.0), suffix="_us", scale=1e-6)

    def at_rest(self, step: float, rng: np.random.Generator) -> tuple[int, float, Array]:
        """It has seen the scanner at rest."""
        return (
            0,
            float(rng.uniform()),
            np.zeros(int((PIPELINE_LATENCY + 1) * self.clock / step) + 2),
        )

    def act(
        self,
        state: tuple[int, float, Array],
        own: Array,
        other: Array,  # noqa: ARG002
        step: float,
    ) -> tuple[tuple[int, float, Array], Array]:
        """Displacement (m) as it is read."""
        elapsed, gone, seen = state
        oldest, clock = elapsed - seen.size, self.clock / step
        seen = np.concatenate((seen, own))
        tick = np.floor(np.arange(elapsed, elapsed + own.size) / clock + gone) - gone
        taken = (tick - PIPELINE_LATENCY) * clock
        after = np.ceil(taken)
        late, ends = after - taken, after.astype(int) - oldest
        read = seen[ends] - late * (seen[ends] - seen[ends - 1])
        return (elapsed + own.size, gone, seen[own.size :]), read


BESSEL = RationalSpec((105.0,), (1.0, 10.0, 45.0, 105.0, 105.0))


@frozen(kw_only=True)
class LinearPhaseSensor(Insert):
    """A sensor behind a Bessel filter of fourth order: a delay at low frequency.

        x_read / x = 105 / (q^4 + 10 q^3 + 45 q^2 + 105 q + 105),    q = s delay

    The phase is that of a delay up to the seventh power of s; the gain falls above 2 / delay. Exact
    for a displacement that is linear within a step. ``delay`` in s. State: the filter's sections
    and the last displacement, m, shape (3,). Source: W. E. Thomson, Proc. IEE 96 (1949) 487.
    """

    KIND: ClassVar[str] = "linear_phase_sensor"
    PLACE: ClassVar[Place] = "displacement"

    delay: float = quantity(gt(0.0), suffix="_us", scale=1e-6)

    def at_rest(self, step: float, rng: np.random.Generator) -> ComplexArray:  # noqa: ARG002
        """It has seen the scanner at rest."""
        return np.zeros(3, dtype=np.complex128)

    def act(
        self,
        state: ComplexArray,
        own: Array,
        other: Array,  # noqa: ARG002
        step: float,
    ) -> tuple[ComplexArray, Array]:
        """Displacement (m) as it is read."""
        poles, residues = fractions(BESSEL)
        upper = poles.imag > 0.0  # one of each conjugate pair
        gains, turns = -2.0 * (residues / poles)[upper], poles[upper] * step / self.delay
        state = state.copy()
        return state, _filter(state, own, turns, gains)


@compiled
def _filter(state: ComplexArray, x: Array, turns: ComplexArray, gains: ComplexArray) -> Array:
    """Sections z' = p (z - x): while x runs straight, z - x tends to its slope over p."""
    read, kept = np.zeros_like(x), np.exp(turns)
    for k in range(x.size):
        moved = x[k] - state[-1].real
        for i in range(turns.size):
            behind = moved / turns[i]
            state[i] = x[k] + behind + kept[i] * (state[i] - state[-1] - behind)
            read[k] += (gains[i] * state[i]).real
        state[-1] = x[k]
    return read


@frozen(kw_only=True)
class LateDivider(Insert):
    """A light spot's sensor that divides by a filtered sum of its photocurrents.

        x_read = x (1 - v) / (1 - w),    v = (x / reach)^2,    settling w' = v - w

    The difference of two photocurrents is x times the light. An aperture takes more of the light at
    larger x, for which the sensor corrects by the sum. The sum is filtered and late: a slow scan is
    read correctly, a fast one with a gain that varies twice a line. The error is a product of
    position and past position, which no catalogued effect describes. Exact where v is linear within
    a step. ``reach`` (m) at which no light would be left, ``settling`` (s). State: w and the last
    v.
    Source: J. T. Wallmark, Proc. IRE 45 (1957) 474 (the sensor).
    """

    KIND: ClassVar[str] = "late_divider"
    PLACE: ClassVar[Place] = "displacement"

    reach: float = quantity(gt(0.0), suffix="_um", scale=1e-6)
    settling: float = quantity(gt(0.0), suffix="_s")

    def at_rest(self, step: float, rng: np.random.Generator) -> Array:  # noqa: ARG002
        """The spot has been in the middle."""
        return np.zeros(2)

    def act(self, state: Array, own: Array, other: Array, step: float) -> tuple[Array, Array]:  # noqa: ARG002
        """Displacement (m) as it is read."""
        missing, pace = (own / self.reach) ** 2, np.array([1.0 / self.settling])
        path = np.concatenate((state[1:], missing))
        filtered = Stepping.of(np.diag(-pace), pace, step).run(state[:1], path)[:, 0]
        after = np.array([filtered[-1], missing[-1]])
        return after, own * (1.0 - missing) / (1.0 - filtered)


HALF_PERIOD = 10e-3  # s, half a period of the mains


@frozen(kw_only=True)
class HumEliminator(Insert):
    """An adaptive filter at the sensor that subtracts mains hum, and a part of the scan.

        x_read = x - m,    m(t) = -((1 - learning) m(t - HALF) + learning x(t - HALF))

    HALF is HALF_PERIOD. The filter averages what changes sign every half period of the mains, and
    subtracts it. A scan leaves decaying echoes of alternating sign, one HALF apart: a comb filter.
    The echoes add up where a harmonic of the line rate meets an odd harmonic of the mains. No
    catalogued effect depends on readings of earlier lines. ``learning``: weight of each half period
    in the average. Readings between two steps are interpolated linearly.

    State: elapsed steps, and -m over the next HALF, m, a ring buffer.
    Source: B. Widrow et al., Proceedings of the IEEE 63 (1975) 1692 (adaptive noise cancelling).
    """

    KIND: ClassVar[str] = "hum_eliminator"
    PLACE: ClassVar[Place] = "displacement"

    learning: float = quantity(ge(0.0), lt(1.0))

    def at_rest(self, step: float, rng: np.random.Generator) -> tuple[int, Array]:  # noqa: ARG002
        """Nothing adapted yet."""
        return 0, np.zeros(int(HALF_PERIOD / step) + 1)

    def act(
        self,
        state: tuple[int, Array],
        own: Array,
        other: Array,  # noqa: ARG002
        step: float,
    ) -> tuple[tuple[int, Array], Array]:
        """Displacement (m) as it is read."""
        elapsed, ring = state[0], state[1].copy()
        between = HALF_PERIOD / step - int(HALF_PERIOD / step)
        read = _listen(ring, own, elapsed % ring.size, between, self.learning)
        return (elapsed + own.size, ring), read


@compiled
def _listen(ring: Array, x: Array, first: int, between: float, learning: float) -> Array:
    read = np.empty_like(x)
    for k in range(x.size):
        now = (first + k) % ring.size
        after = (now + 1) % ring.size
        hum = -(between * ring[now] + (1.0 - between) * ring[after])
        ring[now] = (1.0 - learning) * hum + learning * x[k]
        read[k] = x[k] - hum
    return read
