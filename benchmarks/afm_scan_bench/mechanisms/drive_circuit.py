"""Mechanisms of the drive's circuit: filter, electrodes, ground, leads and converter."""

from typing import ClassVar

import numpy as np
from attrs import frozen
from attrs.validators import ge, gt

from afm_scan_ros.core.compiled import compiled, inlined
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.axis import quantity
from afm_scan_ros.simulation.mechanisms.base import Insert, Place
from afm_scan_ros.simulation.mechanisms.electronics import Charging

CERAMIC_KNEE = 2.5  # V


@frozen(kw_only=True)
class CeramicFilter(Charging):
    """A filter before the amplifier whose ceramic capacitor loses capacitance under voltage.

        resistance C(v) v' = u - v,    C(v) = capacitance / (1 + (v / KNEE)^2)^(1/3)

    KNEE is CERAMIC_KNEE. The dielectric saturates (Landau's law to the fourth power): at 5 V a
    class two capacitor has less of its capacitance than at 0 V. The filter is an input lag that is
    longest about zero. While the converter holds u, C is taken in the middle of a step. The piezo
    sees v. ``capacitance`` is that at 0 V.
    Source: K. M. Johnson, J. Applied Physics 33 (1962) 2826.
    """

    KIND: ClassVar[str] = "ceramic_filter"

    def act(self, state: float, own: Array, other: Array, step: float) -> tuple[float, Array]:  # noqa: ARG002
        """Mean voltage (V) of the capacitor in each step."""
        return _charge(state, own, step / self.constant, CERAMIC_KNEE)


@compiled
def _charge(voltage: float, drive: Array, steps: float, knee: float) -> tuple[float, Array]:
    """``steps``: a step in time constants at no voltage."""
    mean = np.empty_like(drive)
    for k in range(drive.size):
        behind = voltage - drive[k]
        middle = drive[k] + behind * np.exp(-0.5 * steps * _sooner(voltage, knee))
        gone = steps * _sooner(middle, knee)
        mean[k] = drive[k] - behind * np.expm1(-gone) / gone
        voltage = drive[k] + behind * np.exp(-gone)
    return voltage, mean


@inlined
def _sooner(voltage: float, knee: float) -> float:
    """Capacitance at no voltage over that at ``voltage``."""
    return float((1.0 + (voltage / knee) ** 2) ** (1.0 / 3.0))


ELECTRODE_TERMS = 40
ELECTRODE_ROOTS = np.pi * (np.arange(ELECTRODE_TERMS, dtype=np.float64) + 0.5)


@frozen(kw_only=True)
class ResistiveElectrode(Insert):
    """An electrode of high resistance: the charge diffuses along the tube.

        dv/ds = -r i,    di/ds = -c dv/dt,    v = u at one end, i = 0 at the other

    The tube's elongation is the sum over its length, so that the mean of v drives it. It lags by
    resistance * capacitance / 3. Solved by the first modes of the line, exactly while the converter
    holds u. The remaining share 2 / (pi^2 ELECTRODE_TERMS) follows at once. ``resistance`` (Ohm)
    from end to end, ``capacitance`` (F) of the whole. State: the modes, V.
    Source: H. S. Carslaw and J. C. Jaeger, Conduction of Heat in Solids, Oxford 1959, 3.4.
    """

    KIND: ClassVar[str] = "resistive_electrode"
    PLACE: ClassVar[Place] = "drive"

    resistance: float = quantity(gt(0.0), suffix="_ohm")
    capacitance: float = quantity(gt(0.0), suffix="_nf", scale=1e-9)

    def at_rest(self, step: float, rng: np.random.Generator) -> Array:  # noqa: ARG002
        """Discharged."""
        return np.zeros(ELECTRODE_TERMS)

    def act(self, state: Array, own: Array, other: Array, step: float) -> tuple[Array, Array]:  # noqa: ARG002
        """Mean voltage (V) of the tube in each step."""
        modes = state.copy()
        steps = step / (self.resistance * self.capacitance) * ELECTRODE_ROOTS**2
        return modes, _diffuse(modes, own, steps, 2.0 / ELECTRODE_ROOTS**2)


@compiled
def _diffuse(modes: Array, drive: Array, steps: Array, shares: Array) -> Array:
    kept = np.exp(-steps)
    lasting = shares * (1.0 - kept) / steps
    mean = np.empty_like(drive)
    for k in range(drive.size):
        total = drive[k]
        for i in range(modes.size):
            behind = modes[i] - drive[k]
            total += lasting[i] * behind
            modes[i] = drive[k] + kept[i] * behind
        mean[k] = total
    return mean


@frozen(kw_only=True)
class SharedGround(Insert):
    """A ground lead that both amplifiers share: the other axis' current shifts this axis' zero.

        u_out = u + share p,    time_constant dp/dt = u_other - p

    It acts on the drive, before this axis' hysteresis. Exact while the converter holds u_other.
    ``share`` (1), ``time_constant`` (s). State: p, V.
    """

    KIND: ClassVar[str] = "shared_ground"
    PLACE: ClassVar[Place] = "drive"

    share: float = quantity()
    time_constant: float = quantity(gt(0.0), suffix="_us", scale=1e-6)

    def at_rest(self, step: float, rng: np.random.Generator) -> float:  # noqa: ARG002
        """Nothing is picked up."""
        return 0.0

    def act(self, state: float, own: Array, other: Array, step: float) -> tuple[float, Array]:
        """Drive (V) with what is picked up."""
        picked = _lag(state, other, float(np.exp(-step / self.time_constant)))
        return float(picked[-1]), own + self.share * picked


@compiled
def _lag(voltage: float, drive: Array, kept: float) -> Array:
    picked = np.empty_like(drive)
    for k in range(drive.size):
        voltage = drive[k] + kept * (voltage - drive[k])
        picked[k] = voltage
    return picked


CONTACT_CLOSED = 1e-3  # s
CONTACT_OPENINGS = 1_000_000


@frozen(kw_only=True)
class LooseContact(Insert):
    """A lead to the piezo that opens now and then, during which the piezo keeps its charge.

        v = u            while it is closed, CONTACT_CLOSED s on average
            held         while it is open, ``opened`` s on average

    v jumps to u when it closes again. Both durations are exponentially distributed. No catalogued
    effect comes and goes. State: elapsed steps, held voltage (V), times of opening and closing, s.
    Source: R. Holm, Electric Contacts, Springer 1967.
    """

    KIND: ClassVar[str] = "loose_contact"
    PLACE: ClassVar[Place] = "drive"

    opened: float = quantity(ge(0.0), suffix="_us", scale=1e-6)

    def at_rest(self, step: float, rng: np.random.Generator) -> tuple[int, float, Array]:  # noqa: ARG002
        """It touches; when it does not is chance, drawn once for a long while."""
        lasting = rng.exponential(1.0, (CONTACT_OPENINGS, 2)) * (CONTACT_CLOSED, self.opened)
        return 0, 0.0, np.cumsum(lasting.ravel())

    def act(
        self,
        state: tuple[int, float, Array],
        own: Array,
        other: Array,  # noqa: ARG002
        step: float,
    ) -> tuple[tuple[int, float, Array], Array]:
        """Mean voltage (V) across the piezo in each step."""
        elapsed, held, changes = state
        edges = step * np.arange(elapsed, elapsed + own.size + 1, dtype=np.float64)
        if edges[-1] >= changes[-1]:
            raise InputError(
                f"loose_contact: the scan outlasts {CONTACT_OPENINGS} openings: it lasts"
                f" {changes[-1]:.3g} s at most"
            )
        held, mean = _held(held, own, edges, changes)
        return (elapsed + own.size, held, changes), mean


@compiled
def _held(held: float, drive: Array, edges: Array, changes: Array) -> tuple[float, Array]:
    """Mean in each step; an even count of changes so far is a contact that touches."""
    mean, after = np.empty_like(drive), np.searchsorted(changes, edges[0], side="right")
    for k in range(drive.size):
        start, total = edges[k], 0.0
        while start < edges[k + 1]:
            if after % 2 == 0:
                held = drive[k]
            end = min(changes[after], edges[k + 1])
            total += (end - start) * held
            after += changes[after] <= edges[k + 1]
            start = end
        mean[k] = total / (edges[k + 1] - edges[k])
    return held, mean


@frozen(kw_only=True)
class GlitchingConverter(Insert):
    """A converter with a glitch in the middle of its range, where all its bits change.

        u_out = u + height    for ``lasting`` s after an update that takes u across zero
                u             otherwise

    0111... and 1000... are neighbouring codes. While only some bits have changed, the output rises
    towards 1111...: a positive spike in either direction. ``height`` (V), ``lasting`` (s). State:
    the last u, V, and the remaining duration, s.
    Source: W. Kester (ed.), The Data Conversion Handbook, Elsevier 2005.
    """

    KIND: ClassVar[str] = "glitching_converter"
    PLACE: ClassVar[Place] = "drive"

    height: float = quantity(suffix="_v")
    lasting: float = quantity(gt(0.0), suffix="_us", scale=1e-6)

    def at_rest(self, step: float, rng: np.random.Generator) -> Array:  # noqa: ARG002
        """At zero, and no spike."""
        return np.zeros(2)

    def act(self, state: Array, own: Array, other: Array, step: float) -> tuple[Array, Array]:  # noqa: ARG002
        """Mean drive (V) in each step, with the spikes."""
        state = state.copy()
        return state, own + self.height * _spikes(state, own, self.lasting, step)


@compiled
def _spikes(state: Array, drive: Array, lasting: float, step: float) -> Array:
    """Share of each step in which there is a spike."""
    last, left = state
    share = np.empty_like(drive)
    for k in range(drive.size):
        if (drive[k] < 0.0) != (last < 0.0):
            left = lasting
        share[k] = min(left / step, 1.0)
        left = max(left - step, 0.0)
        last = drive[k]
    state[:] = last, left
    return share
