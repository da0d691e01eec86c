"""The parameters of an axis as one vector θ, with their priors.

    y = gain · C(V(F)) + regressors of each record,    F: A = F + Σ_j c_j q_j(F),    A = P(u)

with the operator P (``Plays`` or ``OneState``), the coefficients c_j of the map behind it
(``OutputMap``), the weights κ of the lags and the modes of V, and the gains g of creep C
(``PoleBank``).
"""

from collections.abc import Mapping
from functools import cached_property
from typing import TypeAlias

import numpy as np
from attrs import evolve, frozen
from numpy.typing import NDArray
from scipy.linalg import block_diag

from afm_scan_ros.core.effects.hysteresis.preisach import OutputMap
from afm_scan_ros.core.effects.sensor import SensorModel
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.fit.dynamics import PoleBank
from afm_scan_ros.core.fit.one_state import OneState
from afm_scan_ros.core.fit.plays import Plays
from afm_scan_ros.core.fit.settings import FitSettings
from afm_scan_ros.core.fit.signals import Signals
from afm_scan_ros.core.types import Array

Operator: TypeAlias = Plays | OneState
Columns: TypeAlias = NDArray[np.float32] | NDArray[np.float64]
"""∂A/∂(operator) averaged over stretches, shape (stretches, parameters)."""

Mode: TypeAlias = tuple[float, float, float, float]
"""Angular frequency (rad/s), damping, and both parts of the weight κ."""

SEARCHED = ("smooth_density", "rough_density", "correction", "output_map", "slopes", "creep")
"""Settings that bound standard deviations, which are those of the greatest evidence."""


def first_scales(settings: FitSettings) -> dict[str, float]:
    """Standard deviations at which the search for those of the greatest evidence begins."""
    return {name: settings.first_scale * getattr(settings, name) for name in SEARCHED}


@frozen(eq=False)
class Layout:
    """Which parameter is where in θ, and what is known of each beforehand.

    ``lags`` (s), of which the first is faster than any record shows, and creep's
    ``time_constants`` (s) have fixed places. Last come where depolarised rest is, and what each
    record of an unknown start remembers. Where the sensor is ``delayed``, it is by ``least_delay``
    (s) at least. It ``reads_after`` each update of the drive, or just before. Where it is
    ``linear``, the operator stays a straight line, and V has the gain.
    """

    operator: Operator
    lags: Array
    time_constants: Array
    settings: FitSettings
    modes: int = 0
    unknown_starts: int = 0
    sensor_order: int = 0
    delayed: bool = False
    least_delay: float = 0.0
    reads_after: bool = False
    linear: bool = False

    @cached_property
    def parts(self) -> Mapping[str, slice]:
        """Places of each group of parameters."""
        sizes = {
            **self.operator.parts,
            "map": self.operator.bends,
            "lags": len(self.lags),
            "modes": 4 * self.modes,
            "creep": len(self.time_constants),
            "sensor": (1 if self.sensor_order else 0) + (1 if self.delayed else 0),
            "rest": self.operator.rests,
            "memory": self.unknown_starts * self.operator.unknowns,
        }
        ends = np.cumsum([0, *sizes.values()])
        return {name: slice(a, b) for name, a, b in zip(sizes, ends[:-1], ends[1:], strict=True)}

    @property
    def size(self) -> int:
        """Number of parameters."""
        return int(self.parts["memory"].stop)

    def start(self) -> Array:
        """θ of no hysteresis, no creep, and no vibration that is seen."""
        result = np.zeros(self.size)
        result[: self.parts["map"].start] = self.operator.unbent()
        result[self.parts["lags"].start] = 1.0
        return result

    def of_operator(self, theta: Array) -> Array:
        """Return the operator's parameters."""
        return theta[: self.parts["map"].start]

    def map_of(self, theta: Array) -> OutputMap | None:
        """Return the map from A to F; raises InputError where it turns back."""
        bends = theta[self.parts["map"]]
        ends = self.operator.lower, self.operator.upper
        return OutputMap(*ends, tuple(bends)) if bends.any() and not self.linear else None

    def memory_part(self, record: Signals) -> slice:
        """Place in θ of what says where a record begins; an empty one where nothing does."""
        if record.rested:
            return self.parts["rest"]
        first, count = self.parts["memory"].start, self.operator.unknowns
        if record.unknown is None:
            return slice(first, first)
        return slice(first + count * record.unknown, first + count * (record.unknown + 1))

    def start_of(self, theta: Array, record: Signals) -> tuple[Array, Array]:
        """Return the operator's state (V) before a record, and its derivatives by that part of θ.

        A record of a memory that is neither known nor estimated counts from where it is wiped out.
        """
        if record.rested:
            return self.at_rest(theta)
        part = self.memory_part(record)
        memory = theta[part] if part != slice(part.start, part.start) else None
        known = np.zeros(self.operator.unknowns) if memory is None else memory
        state, changes = self.operator.in_use(float(record.drive[0]), known)
        return state, changes if memory is not None else changes[:, :0]

    def at_rest(self, theta: Array) -> tuple[Array, Array]:
        """Return the operator's state (V) at depolarised rest, and its derivatives by ``rest``."""
        return self.operator.at_rest(theta[self.parts["rest"]])

    def of_modes(self, theta: Array) -> list[Mode]:
        """Return the modes, of which θ holds ln ω, -ln ζ and both parts of κ."""
        modes = theta[self.parts["modes"]].reshape(self.modes, 4)
        return [
            (float(np.exp(omega)), float(np.exp(-sharpness)), float(real), float(imag))
            for omega, sharpness, real, imag in modes
        ]

    def lowest(self) -> Array:
        """Least values of θ: slopes with an inverse, no negative creep, and no broader mode."""
        result = np.full(self.size, -np.inf)
        result[: self.parts["map"].start] = self.operator.lowest
        sharpest = -np.log(self.settings.greatest_damping)
        result[self.parts["modes"]] = np.tile([-np.inf, sharpest, -np.inf, -np.inf], self.modes)
        result[self.parts["creep"]] = 0.0
        if self.delayed:
            result[self.delay_place] = self.least_delay
        return result

    def lacking(self, theta: Array) -> tuple[Array, Array]:
        """Conditions on the operator, where θ fails them: see ``lacking`` of each."""
        rows, lacks = self.operator.lacking(self.of_operator(theta))
        return np.pad(rows, ((0, 0), (0, self.size - rows.shape[1]))), lacks

    def dynamics(self, theta: Array) -> PoleBank:
        """Return the linear part; raises InputError where a mode would not oscillate."""
        modes = self.of_modes(theta)
        if any(damping >= 1.0 for _, damping, *_ in modes):
            raise InputError("a mode of the fit does not oscillate")
        poles = [
            omega * (-damping + 1j * np.sqrt(1.0 - damping**2)) for omega, damping, *_ in modes
        ]
        weights = [real + 1j * imag for *_, real, imag in modes]
        sensor, none = self.sensor_of(theta), np.zeros(0, complex)
        return PoleBank(
            np.concatenate([poles, -1.0 / self.lags]),
            np.concatenate([weights, theta[self.parts["lags"]]]),
            theta[self.parts["creep"]],
            self.time_constants,
            (none, none) if sensor is None else (sensor.poles, sensor.weights),
        )

    def sensor_of(self, theta: Array) -> SensorModel | None:
        """Return the sensor, of which θ holds the logarithm of the corner in Hz, and the delay."""
        if not (self.sensor_order or self.delayed or self.reads_after):
            return None
        corner = float(np.exp(theta[self.parts["sensor"].start])) if self.sensor_order else None
        return SensorModel(self.sensor_order, corner, self.delay_of(theta), self.reads_after)

    def delay_of(self, theta: Array) -> float:
        """Return the delay of the sensor, s."""
        return float(theta[self.delay_place]) if self.delayed else 0.0

    @property
    def delay_place(self) -> int:
        """Place of the delay in θ, where there is one."""
        return int(self.parts["sensor"].stop) - 1

    def with_mode(self, theta: Array, mode: Mode) -> tuple["Layout", Array]:
        """Add a mode, at the expense of the fastest lag."""
        omega, damping, real, imag = mode
        added = [np.log(omega), -np.log(damping), real, imag]
        more = np.insert(theta, self.parts["modes"].stop, added)
        more[self.parts["lags"].start] -= real
        return evolve(self, modes=self.modes + 1), more

    def conditioned(self, matrix: Array) -> Array:
        """Return normal equations whose flattest directions exceed the rounding of others."""
        return np.asarray(matrix + self.settings.least_damping * np.diag(np.diag(matrix)))

    @cached_property
    def static(self) -> Array:
        """Derivatives of V(0), the sum of its weights, shape (size,)."""
        result = np.zeros(self.size)
        result[self.parts["lags"]] = 1.0
        result[self.parts["modes"]] = np.tile([0.0, 0.0, 1.0, 0.0], self.modes)
        return result

    @cached_property
    def unit_gain(self) -> Array:
        """Precision of V(0) about one: to its order, or exactly where the operator has the gain."""
        exact = 1.0 if self.linear else float(np.finfo(np.float32).eps)
        return np.asarray(np.outer(self.static, self.static) / exact)

    def prior(self, scales: Mapping[str, float], theta: Array) -> tuple[Array, Array]:
        """Precision of the prior, and its mean, shapes (size, size) and (size,).

        The frequency of a mode and the sensor's corner are those of ``theta`` within a factor of e,
        the damping is that of the settings within the same factor, and a delay is that of ``theta``
        within the slowest lag, one standard deviation each. All weights of V add up to one, which
        only fixes how the gain is shared with the operator. One that stays a straight line is known
        to rounding.
        """
        parts, s = self.parts, self.settings
        groups = [self.operator.precision(name, scales) for name in self.operator.parts]
        groups.append(
            np.eye(self.operator.bends) / (scales["output_map"] * self.operator.half) ** 2
        )
        groups.append(np.diag([0.0, *np.full(len(self.lags) - 1, s.lag_weight**-2)]))
        weight = s.heaviest_mode**-2
        groups.append(np.diag(np.tile([1.0, 1.0, weight, weight], self.modes)))
        bent = np.diff(np.eye(len(self.time_constants)), 2, axis=0)
        groups.append((bent.T @ bent + 0.1 * np.eye(bent.shape[1])) / scales["creep"] ** 2)
        groups.append(np.eye(1 if self.sensor_order else 0))
        groups.append(np.eye(1 if self.delayed else 0) / self.lags[-1] ** 2)
        groups.append(np.diag(self.operator.expected_rest() ** -2.0))
        groups += self.unknown_starts * [np.diag(self.operator.expected_memory() ** -2.0)]
        matrix, mean = block_diag(*(one for one in groups if len(one))), np.zeros(self.size)
        if self.linear:
            known = np.arange(parts["map"].stop)
            matrix[known, known] += np.finfo(np.float32).eps ** -2.0
            mean[: parts["map"].start] = self.operator.unbent()
        matrix += self.unit_gain
        mean[parts["lags"].start] = 1.0
        first, last = parts["modes"].start, parts["modes"].stop
        mean[first:last:4] = theta[first:last:4]
        mean[first + 1 : last : 4] = -np.log(s.damping)
        mean[parts["sensor"]] = theta[parts["sensor"]]
        return matrix, mean


def layout_of(
    operator: Operator,
    longest: float,
    shortest: float,
    settings: FitSettings,
    omega: float | None = None,
) -> Layout:
    """Places of lags and creep, by the longest record, the shortest sample period and a mode.

    All are in s but ``omega``, in rad/s. Without a mode the samples say what is a lag and what is
    creep.
    """
    slowest, fastest = settings.lag_samples * shortest, settings.creep_samples * shortest
    if omega is not None:
        slowest = settings.slowest_lag / omega
        fastest = max(settings.fastest_creep / omega, 5.0 * shortest)
    lags = np.geomspace(slowest / 8.0, slowest, settings.fast_lags)
    seen = np.concatenate([[0.2 * shortest], lags])
    count = max(round(settings.creep_per_decade * np.log10(longest / fastest)), 3)
    return Layout(operator, seen, np.geomspace(fastest, longest, count), settings)
