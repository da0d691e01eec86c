"""Mechanisms of the drive's amplifier. Exact while the converter holds u, unless stated."""

from typing import ClassVar

import numpy as np
from attrs import frozen
from attrs.validators import gt, lt

from afm_scan_ros.core.compiled import compiled
from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.axis import quantity
from afm_scan_ros.simulation.mechanisms.base import Insert, Place
from afm_scan_ros.simulation.mechanisms.electronics import Charging, follow


@frozen(kw_only=True)
class BufferedAmplifier(Insert):
    """An amplifier of two stages: an input filter, and an output that charges the piezo.

        tau_1 dw/dt = u - w
        tau_2 dv/dt = w - v

    ``slower`` time constant in s; the other one is ``ratio`` times that. State: w and v, V.
    """

    KIND: ClassVar[str] = "buffered_amplifier"
    PLACE: ClassVar[Place] = "drive"

    slower: float = quantity(gt(0.0), suffix="_us", scale=1e-6)
    ratio: float = quantity(gt(0.0), lt(1.0))

    def at_rest(self, step: float, rng: np.random.Generator) -> Array:  # noqa: ARG002
        """Discharged."""
        return np.zeros(2)

    def act(self, state: Array, own: Array, other: Array, step: float) -> tuple[Array, Array]:  # noqa: ARG002
        """Mean voltage (V) across the piezo in each step."""
        state = state.copy()
        return state, _charge_buffered_amplifier(
            state, own, step, self.ratio * self.slower, self.slower
        )


@compiled
def _charge_buffered_amplifier(
    state: Array, drive: Array, step: float, first: float, second: float
) -> Array:
    """Two poles apart: v - u is a sum of two exponentials while u is held."""
    shares = first / (first - second), -second / (first - second)
    kept = np.exp(-step / first), np.exp(-step / second)
    means = (1.0 - kept[0]) * first / step, (1.0 - kept[1]) * second / step
    mean = np.empty_like(drive)
    for k in range(drive.size):
        behind, missing = state[0] - drive[k], state[1] - drive[k]
        fast = shares[0] * behind
        slow = missing - fast
        mean[k] = drive[k] + fast * means[0] + slow * means[1]
        state[0] = drive[k] + behind * kept[0]
        state[1] = drive[k] + fast * kept[0] + slow * kept[1]
    return mean


@frozen(kw_only=True)
class CompressingAmplifier(Insert):
    """An amplifier whose gain falls towards its rails: a differential pair without feedback.

        u_out = rail tanh(u / rail)

    Two emitters share one current source. The drive is distorted before the hysteresis. ``rail`` in
    V is the limit of the output. There is no state.
    Source: P. R. Gray, R. G. Meyer, Analysis and Design of Analog Integrated Circuits, 3.5.
    """

    KIND: ClassVar[str] = "compressing_amplifier"
    PLACE: ClassVar[Place] = "drive"

    rail: float = quantity(gt(0.0), suffix="_v")

    def at_rest(self, step: float, rng: np.random.Generator) -> None:
        """Remember nothing."""

    def act(self, state: None, own: Array, other: Array, step: float) -> tuple[None, Array]:  # noqa: ARG002
        """Drive (V) as it comes out."""
        return None, self.rail * np.tanh(own / self.rail)


@frozen(kw_only=True)
class RingingAmplifier(Insert):
    """An amplifier that rings with the piezo as its load: a loop with little phase margin.

        v'' + 2 d w v' + w^2 v = w^2 u

    The piezo's capacitance behind the output resistance lowers the phase margin of the feedback
    loop. The drive has a resonance before the hysteresis. Solved by the conjugate pair of sections
    z' = p (z - u). ``frequency`` (Hz) and ``damping`` ratio. State: the section z, V.
    """

    KIND: ClassVar[str] = "ringing_amplifier"
    PLACE: ClassVar[Place] = "drive"

    frequency: float = quantity(gt(0.0), suffix="_hz")
    damping: float = quantity(gt(0.0), lt(1.0))

    def at_rest(self, step: float, rng: np.random.Generator) -> complex:  # noqa: ARG002
        """Discharged."""
        return 0j

    def act(self, state: complex, own: Array, other: Array, step: float) -> tuple[complex, Array]:  # noqa: ARG002
        """Mean voltage (V) across the piezo in each step."""
        root = np.sqrt(1.0 - self.damping**2)
        pole = 2.0 * np.pi * self.frequency * complex(-self.damping, root)
        gain = complex(1.0, -self.damping / root)
        return _ring(state, own, pole * step, gain)


@compiled
def _ring(section: complex, drive: Array, turn: complex, gain: complex) -> tuple[complex, Array]:
    kept = np.exp(turn)
    mean, lasting = np.empty_like(drive), (kept - 1.0) / turn
    for k in range(drive.size):
        behind = section - drive[k]
        mean[k] = (gain * (drive[k] + lasting * behind)).real
        section = drive[k] + kept * behind
    return section, mean


SUPPLY = 15.0  # V, to either side of zero


@frozen(kw_only=True)
class SelfHeatingAmplifier(Insert):
    """An amplifier on one chip whose output stage heats its input stage.

        v = u + offset h,    settling h' = P - h,    P = |u| (SUPPLY - |u|) / (SUPPLY / 2)^2

    The output transistor dissipates P: nothing at zero and at the supply, most at half the supply.
    The heat makes the two input transistors unequal, which offsets the drive by 2 mV/K. The error
    depends on the past drive and is even in it, whereas creep is odd. It vanishes at high rates. No
    catalogued effect describes it. ``offset`` (V) in the steady state at half the supply,
    ``settling`` (s). State: h.
    Source: J. E. Solomon, IEEE J. Solid-State Circuits 9 (1974) 314 (thermal feedback).
    """

    KIND: ClassVar[str] = "self_heating_amplifier"
    PLACE: ClassVar[Place] = "drive"

    offset: float = quantity(suffix="_mv", scale=1e-3)
    settling: float = quantity(gt(0.0), suffix="_ms", scale=1e-3)

    def at_rest(self, step: float, rng: np.random.Generator) -> float:  # noqa: ARG002
        """No load, no heat."""
        return 0.0

    def act(self, state: float, own: Array, other: Array, step: float) -> tuple[float, Array]:  # noqa: ARG002
        """Mean voltage (V) across the piezo in each step."""
        power = np.abs(own) * (SUPPLY - np.abs(own)) / (0.5 * SUPPLY) ** 2
        state, warmth = follow(state, power, step / self.settling)
        return state, own + self.offset * warmth


@frozen(kw_only=True)
class SingleEndedAmplifier(Insert):
    """A single-ended high-voltage amplifier: a transistor sources current, a resistor sinks it.

        v = u                                where u rises
        capacitance v' = -(v + SUPPLY) / pull    until v = u, where it falls

    The transistor follows a rising drive at once. When the drive falls, the piezo discharges
    through the load resistor towards the negative supply, faster at higher voltage. This is a slew
    limit in one direction, which depends on the voltage. ``pull`` in Ohm, ``capacitance`` in F.
    State: voltage of the piezo, V.
    Source: P. Horowitz and W. Hill, The Art of Electronics, 2015, 2.2.
    """

    KIND: ClassVar[str] = "single_ended_amplifier"
    PLACE: ClassVar[Place] = "drive"

    pull: float = quantity(gt(0.0), suffix="_kohm", scale=1e3)
    capacitance: float = quantity(gt(0.0), suffix="_nf", scale=1e-9)

    def at_rest(self, step: float, rng: np.random.Generator) -> float:  # noqa: ARG002
        """Discharged."""
        return 0.0

    def act(self, state: float, own: Array, other: Array, step: float) -> tuple[float, Array]:  # noqa: ARG002
        """Mean voltage (V) across the piezo in each step."""
        return _charge_single_ended_amplifier(state, own, step * self.rate, SUPPLY)

    @property
    def rate(self) -> float:
        """Rate of its discharge, 1/s."""
        return 1.0 / (self.pull * self.capacitance)


@compiled
def _charge_single_ended_amplifier(
    voltage: float, drive: Array, steps: float, supply: float
) -> tuple[float, Array]:
    """``steps``: a step in time constants of the discharge, and so is ``falling``."""
    mean = np.empty_like(drive)
    for k in range(drive.size):
        above, falling = voltage + supply, 0.0
        if voltage > drive[k]:
            end = max(drive[k] + supply, above * np.exp(-steps))
            falling = min(np.log(above / end), steps)
            voltage = end - supply
        dropped = -above * np.expm1(-falling)
        mean[k] = (dropped - supply * falling + drive[k] * (steps - falling)) / steps
        voltage = max(voltage, drive[k])
    return voltage, mean


@frozen(kw_only=True)
class StarvedAmplifier(Insert):
    """An amplifier behind a converter of limited power.

        (C v^2 / 2)' <= power while |v| grows;    v = u where that allows

    A flyback converter delivers a constant power at any voltage. The energy of the piezo grows no
    faster, so that the voltage rises more slowly at higher voltage. Discharging is not limited: a
    slew limit away from zero only. ``power`` in W, ``capacitance`` of the piezo in F. State: its
    voltage, V.
    Source: R. W. Erickson, D. Maksimovic, Fundamentals of Power Electronics, 2001, 11 (power
    sources).
    """

    KIND: ClassVar[str] = "starved_amplifier"
    PLACE: ClassVar[Place] = "drive"

    power: float = quantity(gt(0.0), suffix="_uw", scale=1e-6)
    capacitance: float = quantity(gt(0.0), suffix="_nf", scale=1e-9)

    def at_rest(self, step: float, rng: np.random.Generator) -> float:  # noqa: ARG002
        """Discharged."""
        return 0.0

    def act(self, state: float, own: Array, other: Array, step: float) -> tuple[float, Array]:  # noqa: ARG002
        """Mean voltage (V) across the piezo in each step."""
        return _charge_starved_amplifier(state, own, 2.0 * self.power * step / self.capacitance)


@compiled
def _charge_starved_amplifier(voltage: float, drive: Array, gained: float) -> tuple[float, Array]:
    """``gained``: by how much v^2 grows in a step at most, V^2."""
    mean = np.empty_like(drive)
    for k in range(drive.size):
        wanted = abs(drive[k])
        start = min(abs(voltage), wanted) if voltage * drive[k] > 0.0 else 0.0
        charging = min((wanted**2 - start**2) / gained, 1.0)  # share of the step
        end = np.sqrt(start**2 + charging * gained)
        if charging < 1.0:
            end = wanted
        area = 0.0
        if end > start:
            area = 2.0 / 3.0 * (start**2 + start * end + end**2) / (start + end) * charging
        mean[k] = np.sign(drive[k]) * (area + wanted * (1.0 - charging))
        voltage = np.sign(drive[k]) * end
    return voltage, mean


LARGE_ARGUMENT = 20.0  # whose sinh is half its exponential


@frozen(kw_only=True)
class TiredAmplifier(Charging):
    """An amplifier whose current saturates gradually towards its limit.

        C dv/dt = I tanh((u - v) / (R I))

    Integrated in closed form: sinh of the missing voltage decays as an exponential. ``current`` I
    in A; ``capacitance`` C is the piezo's.
    """

    KIND: ClassVar[str] = "tired_amplifier"

    current: float = quantity(gt(0.0), suffix="_ua", scale=1e-6)

    def act(self, state: float, own: Array, other: Array, step: float) -> tuple[float, Array]:  # noqa: ARG002
        """Voltage (V) across the piezo, mean of both ends of each step."""
        kept = float(np.exp(-step / self.constant))
        return _charge_tired_amplifier(state, own, self.resistance * self.current, kept)


@compiled
def _charge_tired_amplifier(
    voltage: float, drive: Array, knee: float, kept: float
) -> tuple[float, Array]:
    mean = np.empty_like(drive)
    for k in range(drive.size):
        missing = (drive[k] - voltage) / knee
        size = abs(missing)
        if size < LARGE_ARGUMENT:
            remaining = np.arcsinh(kept * np.sinh(size))
        else:
            logarithm = size + np.log(kept)
            remaining = (
                logarithm if logarithm > LARGE_ARGUMENT else np.arcsinh(0.5 * np.exp(logarithm))
            )
        after = drive[k] - np.sign(missing) * knee * remaining
        mean[k] = 0.5 * (voltage + after)
        voltage = after
    return voltage, mean
