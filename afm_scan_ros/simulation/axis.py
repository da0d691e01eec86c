"""One axis of the simulated scanner: its parameters, its hysteresis, its vibration and creep."""

from collections.abc import Callable
from typing import Any, TypeAlias

import numpy as np
from attrs import evolve, field, frozen
from attrs.validators import ge, gt, le, lt
from numpy.typing import NDArray

from afm_scan_ros.core.compiled import compiled
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.types import Array

DISTINCT = 1e-4  # relative; roots of a triple pole come out 1e-5 apart


def quantity(*checks: Callable[..., Any], suffix: str = "", scale: float = 1.0) -> Any:  # noqa: ANN401 - attrs types the field by its annotation
    """Declare a number: SI inside, ``name + suffix`` times ``scale`` in the file."""
    return field(validator=list(checks), metadata={"suffix": suffix, "scale": scale})


@frozen
class HysteresisSpec:
    """Play operators of exponentially falling density between two quadratics."""

    elements: int = quantity(ge(1), le(10_000))
    threshold_max: float = quantity(gt(0.0), suffix="_v")
    density: float = quantity(ge(0.0), suffix="_per_v")
    decay: float = quantity(gt(0.0), suffix="_v")
    gain: float = quantity(gt(0.0))
    input_quadratic: float = quantity(suffix="_per_v")
    output_quadratic: float = quantity(suffix="_per_v")


@frozen
class RationalSpec:
    """A stable, proper transfer function of simple poles; polynomials in s, highest power first."""

    numerator: tuple[float, ...]
    denominator: tuple[float, ...]

    def __attrs_post_init__(self) -> None:
        if not self.denominator or self.denominator[0] == 0.0:
            raise InputError("denominator must begin with a coefficient other than 0")
        if not 0 < len(self.numerator) <= len(self.denominator):
            raise InputError("numerator must have 1 coefficient or more, denominator no fewer")
        poles = np.roots(self.denominator)
        if np.any(poles.real >= 0.0):
            raise InputError(f"denominator has the unstable root {max(poles, key=np.real):.6g}/s")
        apart = np.abs(poles[:, None] - poles) + np.diag(np.abs(poles))
        if np.any(apart < DISTINCT * np.abs(poles)):
            raise InputError("denominator has a root twice; move one of the two a little")


@frozen
class ModeSpec:
    """A resonance beside the polynomials; its peak is a share of the polynomials' highest."""

    frequency: float = quantity(gt(0.0), le(1e9), suffix="_hz")
    damping: float = quantity(gt(0.0), lt(0.7))
    relative_peak: float = quantity(gt(0.0), le(1.0))


@frozen
class AxisSpec:
    """One axis: hysteresis (V to V), vibration (sensor volts per V) with modes, creep (1)."""

    hysteresis: HysteresisSpec
    vibration: RationalSpec
    modes: tuple[ModeSpec, ...]
    creep: RationalSpec

    def __attrs_post_init__(self) -> None:
        if len(self.vibration.numerator) == len(self.vibration.denominator):
            raise InputError("vibration: numerator must be of lower order than denominator")
        fastest = max(np.abs(np.roots(self.creep.denominator)), default=0.0)
        if fastest >= min(np.abs(np.roots(self.vibration.denominator))):
            raise InputError(f"creep has a root of {fastest:.6g}/s, as fast as the vibration's")


@frozen(eq=False)
class PlayBank:
    """Hysteresis: a bank of play operators between two quadratics.

    The field v = u + input_quadratic u^2 follows from the drive u, and each play of threshold r
    follows the field at a distance of at most r,

        p_r <- min(max(p_r, v - r), v + r)
        w = v + sum_r rho(r) dr p_r,    F = gain w + output_quadratic w^2.

    Plays have ``thresholds`` (V) and ``weights`` (1), beside ``gain`` (1) and quadratics (1/V).
    State: positions of all plays, V, shape (elements,).

    Thresholds begin at (almost) zero, so that no drive is too small for hysteresis: a small
    oscillation follows Rayleigh's law. The quadratics make the loop asymmetric. That of the output
    makes minor loops incongruent, that of the input those of the inverse (from F to u), so that a
    Preisach operator of either needs a memoryless map beside it to represent this plant.
    Assumptions: independent of rate and of the load. Source: M. Brokate and J. Sprekels, Hysteresis
    and Phase Transitions, Springer 1996 (plays); Lord Rayleigh, 1887 (the law at small signals).
    """

    thresholds: Array
    weights: Array
    gain: float
    input_quadratic: float
    output_quadratic: float

    @classmethod
    def from_spec(cls, spec: HysteresisSpec) -> "PlayBank":
        """Discretise the density ``density * exp(-r / decay)``, finest near r = 0."""
        edges = spec.threshold_max * (np.arange(spec.elements + 1) / spec.elements) ** 2
        thresholds = (edges[1:] + edges[:-1]) / 2.0
        weights = spec.density * np.exp(-thresholds / spec.decay) * np.diff(edges)
        quadratics = (spec.input_quadratic, spec.output_quadratic)
        return cls(thresholds, weights, spec.gain, *quadratics)

    def relaxed(self) -> Array:
        """State of a virgin scanner: never driven, every play in its middle."""
        return np.zeros_like(self.thresholds)

    def apply(self, plays: Array, drive: Array) -> tuple[Array, Array]:
        """Effective input F (V) for a block of drive (V), both of shape (n,)."""
        plays = plays.copy()
        total = _follow(self.field(drive), self.thresholds, self.weights, plays)
        return plays, self.effective(total)

    def field(self, drive: Array) -> Array:
        """Field v (V) that the plays follow."""
        return drive + self.input_quadratic * drive**2

    def effective(self, total: Array) -> Array:
        """Effective input F (V) of the field and all plays together, w (V)."""
        return (self.gain + self.output_quadratic * total) * total


@compiled
def _follow(field: Array, thresholds: Array, weights: Array, plays: Array) -> Array:
    total = np.empty_like(field)
    for k in range(field.size):
        v = field[k]
        if k > 0 and v == field[k - 1]:  # held: no play moves
            total[k] = total[k - 1]
            continue
        for i in range(plays.size):
            plays[i] = min(max(plays[i], v - thresholds[i]), v + thresholds[i])
        total[k] = v + np.dot(weights, plays)
    return total


ComplexArray: TypeAlias = NDArray[np.complex128]

PEAK_GRID = np.linspace(-1.0, 1.0, 2001)  # a pole's peak lies within its half-width


@frozen(eq=False)
class Dynamics:
    """Vibration and creep, exact between the converter's updates.

    The cascade V(s) Gc(s) (paper, Eqs. 5 and 6 in x, 8 and 9 in y, and the plant's further modes in
    parallel to V) is expanded in partial fractions, one first-order section a pole:

        dz/dt = p (z - F),    x = Re sum c z.

    While the converter holds F for a time T, z moves by exactly (1 - e^{pT}) (F - z): no
    integrator, no step size, and time constants from microseconds to an hour together. 1 - e^{pT}
    is taken from expm1, since e^{pT} itself rounds 10 us beside 1700 s away.

    Sections have ``poles`` (1/s; one of each conjugate pair) and ``gains`` (m/V). State: the
    sections' values z, V, shape (poles,).
    """

    poles: ComplexArray
    gains: ComplexArray

    @classmethod
    def from_spec(cls, spec: AxisSpec, sensor_sensitivity: float) -> "Dynamics":
        """Expand vibration, modes and creep; ``sensor_sensitivity`` in m per sensor volt."""
        fast, fast_residues = _vibration(spec)
        slow, slow_residues = fractions(spec.creep)
        at_slow = np.sum(fast_residues / (slow[:, None] - fast), axis=1)
        poles = np.concatenate([fast, slow])
        residues = np.concatenate(
            [fast_residues * _value(spec.creep, fast), slow_residues * at_slow]
        )
        kept = poles.imag >= 0.0
        pairs = np.where(poles.imag > 0.0, 2.0, 1.0)
        gains = -sensor_sensitivity * pairs * residues / poles
        return cls(poles[kept], gains[kept])

    def at_rest(self) -> ComplexArray:
        """State of a scanner that was never driven."""
        return np.zeros_like(self.poles)

    def apply(
        self, sections: ComplexArray, effective: Array, sample_period: float
    ) -> tuple[ComplexArray, Array]:
        """Displacement (m) just before each update of the held input F (V), both of shape (n,)."""
        sections = sections.copy()
        steps = -np.expm1(self.poles * sample_period)
        return sections, _advance(effective, steps, self.gains, sections)

    def response(self, omega: Array) -> ComplexArray:
        """Frequency response from F to displacement, m/V, at ``omega`` rad/s, shape (n,)."""
        s = 1j * np.asarray(omega)[:, None]
        residues = -self.gains * self.poles
        below = residues.conj() / (s - self.poles.conj())
        total: ComplexArray = 0.5 * np.sum(residues / (s - self.poles) + below, axis=1)
        return total


def fractions(rational: RationalSpec) -> tuple[ComplexArray, ComplexArray]:
    """Poles (1/s) and their residues."""
    poles = np.roots(rational.denominator).astype(np.complex128)
    slope = np.polyval(np.polyder(rational.denominator), poles)
    residues: ComplexArray = np.polyval(rational.numerator, poles) / slope
    return poles, residues


def first_resonance(vibration: RationalSpec) -> complex:
    """Pole (1/s) of the first resonance: of the least damped pair."""
    poles = np.roots(vibration.denominator)
    return complex(poles[np.argmin(-poles.real / np.abs(poles))])


def highest_peak(vibration: RationalSpec) -> float:
    """Largest magnitude of a transfer function on the imaginary axis, near its resonances."""
    poles = np.roots(vibration.denominator)
    omega: Array = poles.imag[:, None] + poles.real[:, None] * PEAK_GRID
    return float(np.max(np.abs(_value(vibration, 1j * omega))))


def _vibration(spec: AxisSpec) -> tuple[ComplexArray, ComplexArray]:
    peak = highest_peak(spec.vibration)
    parts = [fractions(spec.vibration)]
    parts += [_mode_fractions(mode, peak * mode.relative_peak) for mode in spec.modes]
    poles, residues = zip(*parts, strict=True)
    return np.concatenate(poles), np.concatenate(residues)


def _mode_fractions(mode: ModeSpec, peak: float) -> tuple[ComplexArray, ComplexArray]:
    omega, root = 2.0 * np.pi * mode.frequency, np.sqrt(1.0 - mode.damping**2)
    static = peak * 2.0 * mode.damping * root
    poles = omega * (np.array([1j, -1j]) * root - mode.damping)
    residues: ComplexArray = static * omega**2 / (2j * poles.imag)
    return poles, residues


def _value(rational: RationalSpec, s: NDArray[np.complexfloating[Any, Any]]) -> ComplexArray:
    value: ComplexArray = np.polyval(rational.numerator, s) / np.polyval(rational.denominator, s)
    return value


def series(creep: RationalSpec) -> tuple[Array, Array]:
    """Gains g (1) and time constants tau (s) of d + sum g / (1 + s tau), slowest first."""
    poles, residues = (part.real for part in fractions(creep))
    order = np.argsort(-poles)
    return (-residues / poles)[order], (-1.0 / poles)[order]


def with_series(creep: RationalSpec, gains: Array, taus: Array) -> RationalSpec:
    """Creep that moves at once as ``creep`` does, and then with these gains and constants."""
    poles = -1.0 / taus
    numerator = np.poly(poles) * (creep.numerator[0] / creep.denominator[0])
    for i, (gain, pole) in enumerate(zip(gains, poles, strict=True)):
        numerator[1:] -= gain * pole * np.poly(np.delete(poles, i))
    return RationalSpec(tuple(numerator.tolist()), tuple(np.poly(poles).tolist()))


def detuned_axis(axis: AxisSpec, frequency: float, damping: float) -> AxisSpec:
    """Axis whose first resonance has its frequency and damping ratio times these factors.

    Static gain, other poles, zeros and peaks are unchanged. InputError where it would be unstable.
    """
    vibration = _moved(axis.vibration, frequency, damping)
    share = highest_peak(axis.vibration) / highest_peak(vibration)
    modes = tuple(evolve(mode, relative_peak=share * mode.relative_peak) for mode in axis.modes)
    return evolve(axis, vibration=vibration, modes=modes)


def _moved(vibration: RationalSpec, frequency: float, damping: float) -> RationalSpec:
    poles = np.roots(vibration.denominator)
    first = first_resonance(vibration)
    pair = np.isclose(poles, first) | np.isclose(poles, first.conjugate())
    natural = np.abs(first) * frequency
    ratio = -first.real / np.abs(first) * damping
    poles[pair] = np.roots([1.0, 2.0 * ratio * natural, natural**2])
    denominator = vibration.denominator[0] * np.poly(poles).real
    scale = denominator[-1] / vibration.denominator[-1]
    numerator = scale * np.array(vibration.numerator)
    return RationalSpec(tuple(numerator.tolist()), tuple(denominator.tolist()))


@compiled
def _advance(
    effective: Array, steps: ComplexArray, gains: ComplexArray, sections: ComplexArray
) -> Array:
    displacement = np.empty_like(effective)
    for k in range(effective.size):
        total = 0.0
        for i in range(sections.size):
            total += gains[i].real * sections[i].real - gains[i].imag * sections[i].imag
            sections[i] += steps[i] * (effective[k] - sections[i])
        displacement[k] = total
    return displacement
