"""Mechanisms of the ferroelectric material's hysteresis."""

from typing import ClassVar

import numpy as np
from attrs import evolve, frozen
from attrs.validators import ge, gt

from afm_scan_ros.core.compiled import compiled
from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.axis import AxisSpec, PlayBank, quantity
from afm_scan_ros.simulation.mechanisms.base import Alteration, Blocks, Insert, Place
from afm_scan_ros.simulation.mechanisms.material import DraggedBank


@frozen(kw_only=True)
class ActivatedBlocks(Blocks):
    """Hysteresis with thermally activated slip: each play slips faster the harder it is pulled.

        dp_r/dt = slip_speed sinh(e / activation),    e = the part of v - p_r beyond +-r

    Eyring's law of activated flow. At a constant speed e grows as the logarithm of the speed; at
    small pulls the law is that of a viscous film. While the drive is held, tanh(e / 2 activation)
    decays as an exponential, from which e follows exactly. Its mean over a step is taken by
    Simpson's rule. ``activation`` in V, ``slip_speed`` in V/s. Source: H. Eyring, J. Chem. Phys. 4
    (1936) 283.
    """

    KIND: ClassVar[str] = "activated_blocks"

    activation: float = quantity(gt(0.0), suffix="_mv", scale=1e-3)
    slip_speed: float = quantity(gt(0.0), suffix="_v_per_s")

    def bank(self, plays: PlayBank, step: float) -> "ActivatedBank":
        """The hysteresis with such blocks, for a drive that is held for ``step`` s."""
        half = 0.5 * step * self.slip_speed / self.activation
        return ActivatedBank(plays, 2.0 * self.activation, half)


@frozen(eq=False)
class ActivatedBank(DraggedBank):
    """The ``plays`` of a hysteresis; tanh of a pull over ``scale`` (V) decays by e in 1 / ``half``.

    ``half`` is half a step.
    """

    scale: float
    half: float

    def dragged(self, field: Array, positions: Array) -> Array:
        """Mean of field and blocks, V, in each step; moves ``positions``."""
        plays, law = self.plays, (self.scale, float(np.exp(-self.half)))
        return _drag_activated_blocks(field, plays.thresholds, plays.weights, positions, law)


@compiled
def _drag_activated_blocks(
    field: Array, thresholds: Array, weights: Array, positions: Array, law: tuple[float, float]
) -> Array:
    scale, kept = law
    total = np.empty_like(field)
    for k in range(field.size):
        v = field[k]
        total[k] = v
        for i in range(positions.size):
            target = min(max(positions[i], v - thresholds[i]), v + thresholds[i])
            pull = target - positions[i]
            middle = after = 0.0
            if pull != 0.0:
                ahead = np.tanh(pull / scale)
                middle = scale * np.arctanh(kept * ahead)
                after = scale * np.arctanh(kept * kept * ahead)
            positions[i] = target - after
            total[k] += weights[i] * (target - (pull + 4.0 * middle + after) / 6.0)
    return total


ROUNDING = 80e-6
"""s; in which the amplifier rounds the converter's steps, which have no speed."""


@frozen(kw_only=True)
class HastenedBlocks(Blocks):
    """Hysteresis whose thresholds grow with the speed of the drive.

        r_i' = r_i (1 + hardening |dv/dt|),    p_i <- min(max(p_i, v - r_i'), v + r_i')

    The rate-dependent Prandtl-Ishlinskii operator: the faster the scan, the wider the loop.
    ``hardening`` in s/V: relative growth of every threshold per V/s.
    Source: M. Al Janaideh, S. Rakheja, C.-Y. Su, Smart Mater. Struct. 18 (2009) 045018.
    """

    KIND: ClassVar[str] = "hastened_blocks"

    hardening: float = quantity(ge(0.0), suffix="_us_per_v", scale=1e-6)

    def bank(self, plays: PlayBank, step: float) -> "HastenedBank":
        """The hysteresis with these thresholds, for a drive that is held for ``step`` s."""
        return HastenedBank(plays, self.hardening, step)


@frozen(eq=False)
class HastenedBank:
    """The ``plays`` of a hysteresis with thresholds that a speed raises by ``hardening`` (s/V).

    State: the blocks' positions and the last field, V, and its rounded speed, V/s; shape
    (elements + 2,).
    """

    plays: PlayBank
    hardening: float
    step: float

    def relaxed(self) -> Array:
        """State of a virgin scanner."""
        return np.concatenate((self.plays.relaxed(), np.zeros(2)))

    def apply(self, state: Array, drive: Array) -> tuple[Array, Array]:
        """Effective input F (V) of drive (V), both of shape (n,)."""
        state, plays = state.copy(), self.plays
        film = (self.hardening, self.step)
        total = _drag_hastened_blocks(
            plays.field(drive), plays.thresholds, plays.weights, state, film
        )
        return state, plays.effective(total)


@compiled
def _drag_hastened_blocks(
    field: Array, thresholds: Array, weights: Array, state: Array, film: tuple[float, float]
) -> Array:
    hardening, step = film
    kept = np.exp(-step / ROUNDING)
    count = thresholds.size
    total = np.empty_like(field)
    for k in range(field.size):
        v = field[k]
        speed = state[count + 1] + (v - state[count]) / ROUNDING
        state[count], state[count + 1] = v, kept * speed
        total[k] = v
        for rate in (speed, kept * speed):  # at both ends of the step
            for i in range(count):
                reach = thresholds[i] * (1.0 + hardening * abs(rate))
                state[i] = min(max(state[i], v - reach), v + reach)
                total[k] += 0.5 * weights[i] * state[i]
    return total


@frozen(kw_only=True)
class ThinningBlocks(Blocks):
    """Hysteresis with a shear-thinning film: twice the pull moves a play four times as fast.

        dp_r/dt = e |e| / film,    e = the part of v - p_r beyond +-r

    A grease flows by a power of its stress (Ostwald and de Waele), here the square. At a constant
    speed the lag is the root of the speed, between the proportional lag of a viscous film and the
    logarithmic lag of activated flow. While the drive is held 1 / |e| grows by t / film, from which
    e and its mean follow exactly. ``film`` in V s: the square of a pull (V) over the speed (V/s)
    that it causes.
    Source: R. B. Bird, R. C. Armstrong, O. Hassager, Dynamics of Polymeric Liquids, Wiley 1987,
    4.1.
    """

    KIND: ClassVar[str] = "thinning_blocks"

    film: float = quantity(gt(0.0), suffix="_uv_s", scale=1e-6)

    def bank(self, plays: PlayBank, step: float) -> "ThinningBank":
        """The hysteresis with the film, for a drive that is held for ``step`` s."""
        return ThinningBank(plays, step / self.film)


@frozen(eq=False)
class ThinningBank(DraggedBank):
    """The ``plays`` of a hysteresis; one over a pull grows by ``thinned`` (1/V) in a step."""

    thinned: float

    def dragged(self, field: Array, positions: Array) -> Array:
        """Mean of field and blocks, V, in each step; moves ``positions``."""
        plays = self.plays
        return _drag_thinning_blocks(
            field, plays.thresholds, plays.weights, positions, self.thinned
        )


@compiled
def _drag_thinning_blocks(
    field: Array, thresholds: Array, weights: Array, positions: Array, thinned: float
) -> Array:
    total = np.empty_like(field)
    for k in range(field.size):
        v = field[k]
        total[k] = v
        for i in range(positions.size):
            target = min(max(positions[i], v - thresholds[i]), v + thresholds[i])
            pull = target - positions[i]
            steps = abs(pull) * thinned
            mean = np.sign(pull) * np.log1p(steps) / thinned
            positions[i] = target - pull / (1.0 + steps)
            total[k] += weights[i] * (target - mean)
    return total


@frozen(kw_only=True)
class HardenedDomains(Alteration):
    """Domains that are pinned more, or less, than before: the loop is wider or narrower.

        density' = factor density

    ``factor`` of the density of plays at every threshold.
    """

    KIND: ClassVar[str] = "hardened_domains"

    factor: float = quantity(ge(0.0))

    def altered(self, axis: AxisSpec) -> AxisSpec:
        """More, or fewer, domains that lag behind the field."""
        density = self.factor * axis.hysteresis.density
        return evolve(axis, hysteresis=evolve(axis.hysteresis, density=density))


CRACKLING_TONES = 400


@frozen(kw_only=True)
class CracklingDomains(Insert):
    """Barkhausen noise: domain walls that run through a random pinning field.

        u_out = u + n(s) - n(0),    s = the integral of |du|,
        n = amplitude sqrt(2 / TONES) sum cos(k_i s + phase_i)
        <n(s) n(s + d)> = amplitude^2 e^(-d / length)

    TONES is CRACKLING_TONES. The pinning force is a random walk along the wall's path with a
    restoring force (Alessandro, Beatrice, Bertotti, Montorsi). The noise is constant while the
    drive rests and advances with it in either direction. It repeats neither in time nor in
    position: no catalogued effect describes it. Tones whose wave numbers have Cauchy's distribution
    have this covariance, and their sum is nearly Gaussian (Rice). ``amplitude`` (V), rms;
    ``length`` (V) of the correlation.

    State: path s (V), last u (V) and last sum of the tones, shape (3,), and the tones' wave numbers
    (1/V) and phases (rad), shape (2, CRACKLING_TONES).
    Source: B. Alessandro, C. Beatrice, G. Bertotti, A. Montorsi, J. Applied Physics 68 (1990) 2901;
    V. M. Rudyak, Soviet Physics Uspekhi 13 (1971) 461 (in ferroelectrics).
    """

    KIND: ClassVar[str] = "crackling_domains"
    PLACE: ClassVar[Place] = "drive"

    amplitude: float = quantity(suffix="_mv", scale=1e-3)
    length: float = quantity(gt(0.0), suffix="_v")

    def at_rest(self, step: float, rng: np.random.Generator) -> tuple[Array, Array]:  # noqa: ARG002
        """Never driven, in a ground drawn by chance."""
        numbers = rng.standard_cauchy(CRACKLING_TONES) / self.length
        phases = rng.uniform(0.0, 2.0 * np.pi, CRACKLING_TONES)
        return np.array([0.0, 0.0, np.cos(phases).sum()]), np.stack((numbers, phases))

    def act(
        self,
        state: tuple[Array, Array],
        own: Array,
        other: Array,  # noqa: ARG002
        step: float,  # noqa: ARG002
    ) -> tuple[tuple[Array, Array], Array]:
        """Drive (V) that the domains follow."""
        moving, tones = state[0].copy(), state[1]
        noise = _crackle(moving, own, tones) - np.cos(tones[1]).sum()
        return (moving, tones), own + self.amplitude * np.sqrt(2.0 / CRACKLING_TONES) * noise


@compiled
def _crackle(moving: Array, drive: Array, tones: Array) -> Array:
    way, last, total = moving
    noise = np.empty_like(drive)
    for k in range(drive.size):
        if drive[k] != last:
            way, last, total = way + abs(drive[k] - last), drive[k], 0.0
            for i in range(tones.shape[1]):
                total += np.cos(tones[0, i] * way + tones[1, i])
        noise[k] = total
    moving[:] = way, last, total
    return noise
