"""Vibration: the scanner's structure resonates.

G(s) = n(s) / d(s) e^{-sτ} in m/V, Croft, Shed and Devasia (2001), Eqs. 5 and 8. The delay τ is that
of the record or the converter; the paper has none.
Assumptions: the vibration is linear, and the converter holds its output between samples (zero-order
hold). A sample of the displacement is taken just before the converter's update, so displacement k
depends on inputs up to k - 1. The discretisation is exact under these assumptions.
"""

from functools import cached_property, lru_cache

import numpy as np
from attrs import field, frozen
from numpy.typing import NDArray
from scipy.linalg import companion, expm

from afm_scan_ros.core.effects import optimal_inverse as optimal
from afm_scan_ros.core.effects.lti import SampledSystem
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.types import Array, floats

LONGEST_DELAY = 1.0
"""Seconds."""
OSCILLATES = 0.5
"""Damping from which on a pair of poles is no resonance."""


@frozen
class VibrationModel:
    """Polynomials of G(s) in descending powers of s, the numerator in m/V, and a ``delay`` in s.

    Raises InputError unless G is stable, falls off at high frequency and has a positive G(0), or
    where the delay is negative or longer than any preview.
    """

    numerator: tuple[float, ...] = field(converter=floats)
    denominator: tuple[float, ...] = field(converter=floats)
    delay: float = field(default=0.0, converter=float)

    def __attrs_post_init__(self) -> None:
        if not 0.0 <= self.delay <= LONGEST_DELAY:
            raise InputError(
                f"the vibration model's delay is {self.delay:g} s, not from 0 to {LONGEST_DELAY:g}"
            )
        if not np.isfinite([*self.numerator, *self.denominator]).all():
            raise InputError("the vibration polynomials must be finite numbers")
        if not 0 < len(self.numerator) < len(self.denominator) or self.denominator[0] == 0.0:
            raise InputError("the vibration numerator must be of lower degree than the denominator")
        if np.roots(self.denominator).real.max() >= 0.0:
            raise InputError("the vibration denominator has a root that is not damped")
        if self.static_gain <= 0.0:
            raise InputError(f"the vibration model's gain at rest is {self.static_gain:g}, not > 0")

    @property
    def static_gain(self) -> float:
        """G(0), m/V."""
        return self.numerator[-1] / self.denominator[-1]

    def response(self, omega: Array) -> NDArray[np.complex128]:
        """G(jω) at angular frequencies ``omega`` in rad/s, same shape."""
        s = 1j * np.asarray(omega)
        result: NDArray[np.complex128] = np.polyval(self.numerator, s) / np.polyval(
            self.denominator, s
        )
        late: NDArray[np.complex128] = np.exp(-s * self.delay)
        return result * late

    @cached_property
    def resonant_pole(self) -> complex | None:
        """Pole (rad/s) of the resonance that rises highest: the stage's own. None without one."""
        poles = np.roots(self.denominator)
        poles = poles[(poles.imag > 0.0) & (-poles.real < OSCILLATES * np.abs(poles))]
        if not poles.size:
            return None
        residues = np.polyval(self.numerator, poles) / np.polyval(
            np.polyder(self.denominator), poles
        )
        return complex(poles[np.abs(residues / poles.real).argmax()])

    @property
    def natural_frequency(self) -> float:
        """Frequency (Hz) of the resonance that rises highest, or else of the slowest pole."""
        pole = self.resonant_pole
        slowest = np.abs(np.roots(self.denominator)).min() if pole is None else abs(pole)
        return float(slowest / (2.0 * np.pi))


def resonant(omega: float, damping: float) -> Array:
    """Return s² + 2 damping omega s + omega², omega in rad/s."""
    return np.array([1.0, 2.0 * damping * omega, omega**2])


@frozen
class Resonance:
    """G's denominator is ``rest`` times s² + 2 ``damping`` ``omega`` s + ``omega``² (rad/s)."""

    omega: float
    damping: float
    rest: tuple[float, ...] = field(converter=floats)

    @property
    def frequency(self) -> float:
        """Frequency without damping, Hz."""
        return self.omega / (2.0 * np.pi)

    @property
    def factor(self) -> Array:
        """Its polynomial in descending powers of s, shape (3,)."""
        return resonant(self.omega, self.damping)


def first_resonance(vibration: VibrationModel) -> Resonance:
    """Return the resonance that rises highest; raises InputError where there is none."""
    if (pole := vibration.resonant_pole) is None:
        raise InputError("the vibration model has no resonance: leave out effects that act on one")
    omega, damping = abs(pole), -pole.real / abs(pole)
    rest = np.polydiv(vibration.denominator, resonant(omega, damping))[0]
    return Resonance(omega, damping, rest)


LARGEST_TAIL = 1e-4
"""Share of the inverse's response that may lie ahead of the preview."""
PERIODS = 9.0
"""Of the first resonance, that a preview lasts at least: nothing of the response of a well damped
scanner lies ahead of it, 1e-11 on the default plant."""


@lru_cache(maxsize=64)
def held(model: VibrationModel, sample_period: float) -> SampledSystem:
    """Sample G behind a zero-order hold, exactly; a fit asks for the last systems again."""
    whole, part = divmod(model.delay / sample_period, 1.0)
    a, late, c = _discrete(model, sample_period)
    if part == 0.0:
        return SampledSystem(a, late, c, 0.0, sample_period, int(whole))
    # Within a period the input before still acts for its first part, and is one more state.
    b = _discrete(model, (1.0 - part) * sample_period)[1]
    a = np.block([[a, (late - b)[:, np.newaxis]], [np.zeros((1, len(b) + 1))]])
    b, c = np.append(b, 1.0), np.append(c, 0.0)
    return SampledSystem(a, b, c, 0.0, sample_period, int(whole))


def _discrete(model: VibrationModel, period: float) -> tuple[Array, Array, Array]:
    """Matrices a (n, n), b (n,) and c (n,) of G without its delay, an input held for a period."""
    degree = len(model.denominator) - 1
    scale = abs(model.denominator[-1] / model.denominator[0]) ** (1.0 / degree)
    powers = scale ** np.arange(degree, -1.0, -1.0)
    denominator = np.array(model.denominator) * powers
    read_out = np.zeros((1, degree))
    read_out[0, -len(model.numerator) :] = model.numerator * powers[-len(model.numerator) :]
    # Of the state and of the input held. SciPy 1.11 overflows for large matrices of 2 by 2.
    continuous = np.zeros((max(degree + 1, 3),) * 2)
    continuous[:degree, :degree], continuous[0, degree] = companion(denominator), 1.0
    discrete = expm(period * scale * continuous)
    return discrete[:degree, :degree], discrete[:degree, degree], read_out[0] / denominator[0]


class Vibration:
    """Vibration of one axis; the state is that of the sampled system, then the inputs delayed.

    The inverse is the optimal one, exact at rest, its ``preview`` (s) as long as it needs if None.
    ``before`` is the vibration that the weight was chosen for, where another one multiplies it.
    """

    def __init__(
        self,
        model: VibrationModel,
        sample_period: float,
        weight: optimal.Weight | optimal.RelativeWeight | None = None,
        preview: float | None = None,
        before: VibrationModel | None = None,
    ) -> None:
        self._system = held(model, sample_period)
        self._model, self._sample_period = model, sample_period
        self._chosen = weight or optimal.RelativeWeight()
        self._given, self._before = preview, before

    @cached_property
    def inverse(self) -> optimal.OptimalInverse:
        """The optimal inverse; InputError where it does not die out, or for too short a preview."""
        kernel = optimal.optimal_kernel(self._system.response, self._weight(), self._sample_period)
        return optimal.OptimalInverse(kernel, self._preview(kernel, self._given))

    def _weight(self) -> optimal.Weight:
        weight, chosen_for = self._chosen, self._before or self._model
        if isinstance(weight, optimal.RelativeWeight):
            weight = weight.at(chosen_for.natural_frequency)
        if self._before is None:
            return weight
        response, before = self._system.response, held(chosen_for, self._sample_period).response
        return optimal.MultipliedWeight(weight, lambda w: np.abs(response(w) / before(w)) ** 2)

    def _preview(self, kernel: optimal.Kernel, given: float | None) -> int:
        """Return the preview, samples; refuse one (s) that is too short."""
        if given is None:
            least = round(PERIODS / (self._model.natural_frequency * self._sample_period))
            return max(least, kernel.preview_needed(LARGEST_TAIL))
        preview = round(given / self._sample_period)
        if (tail := kernel.tail_ahead(preview)) > LARGEST_TAIL:
            needed = kernel.preview_needed(LARGEST_TAIL) * self._sample_period
            raise InputError(
                f"a preview of {preview} samples, {1e3 * given:g} ms, cuts off"
                f" {tail:.2g} of the inverse vibration's response at"
                f" {1.0 / self._sample_period:g} Hz: give at least {1e3 * needed:.3g} ms, or"
                " another sample rate"
            )
        return preview

    def at_rest(self) -> Array:
        """State at rest at zero, shape (n + delay,)."""
        return self._system.at_rest()

    def apply(self, state: Array, block: Array) -> tuple[Array, Array]:
        """Displacement (m) under a block of held inputs (V), both (n,)."""
        return self._system.apply(state, block)

    def inverse_at_rest(self) -> Array:
        """State of the inverse before sample 0: every earlier target was zero."""
        return self.inverse.at_rest()

    def invert(self, state: Array, block: Array) -> tuple[Array, Array]:
        """Inputs (V) whose displacement follows the targets ``block`` (m), delayed by preview."""
        return self.inverse.invert(state, block)

    def finish(self, state: Array) -> Array:
        """Inputs still owed, the last target being held."""
        return self.inverse.finish(state)


SENSOR_SENSITIVITY = 8.0e-6
"""m per sensor volt: an assumption of this package, the paper publishes none."""
