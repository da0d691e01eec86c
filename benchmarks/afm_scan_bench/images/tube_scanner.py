"""Tube scanners without a sensor, drawn at random: both axes, coupled, on a sample that drifts.

They share no code with what inverts them. Hysteresis is that of ``families``, between memoryless
maps; vibration and creep are those of the simulated scanner, exact while the drive is held.
"""

from typing import Any

import numpy as np
from attrs import frozen

from afm_scan_bench.any_lab.scanner import DRAWN_FOR, FAMILIES, hysteresis
from afm_scan_bench.families.operators import Mapped, applied
from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.dynamics import ComplexArray, Dynamics

TAUS = (0.1, 1.0, 10.0, 100.0)
"""Time constants of creep (s), each drawn about its value: creep is logarithmic in time."""


@frozen
class Mode:
    """A resonance (Hz), its damping, and its share of the static displacement."""

    frequency: float
    damping: float
    share: float


@frozen(eq=False)
class TubeAxis:
    """Drive (V), scaled to ±4 V → hysteresis → modes → creep → displacement (m).

    ``gain`` is in m per V behind the hysteresis, ``creep`` holds gains (1) and time constants (s).
    """

    family: str
    hysteresis: Mapped
    dynamics: Dynamics
    modes: tuple[Mode, ...]
    creep: tuple[tuple[float, float], ...]
    gain: float


@frozen(eq=False)
class TubeState:
    """What a scanner remembers: of each axis its hysteresis and sections, then place and time.

    ``place`` (m) is that of each axis without coupling at ``time`` (s).
    """

    hysteresis: tuple[Any, Any]
    sections: tuple[ComplexArray, ComplexArray]
    place: tuple[float, float]
    time: float


@frozen(eq=False)
class TubeScanner:
    """Axes x and y for drives to ``upper`` (V) either way.

    ``coupling`` is what x has of y and y of x (1). The sample drifts by ``drift`` (m/s) at first,
    ever less with the time constant ``settling`` (s). ``nominal`` (m/V) is what the controller
    takes each axis' sensitivity for, ``reach`` (m) how far an axis goes from end to end.
    """

    axes: tuple[TubeAxis, TubeAxis]
    upper: float
    reach: tuple[float, float]
    coupling: tuple[float, float]
    drift: tuple[float, float]
    settling: float
    nominal: tuple[float, float]

    @property
    def fastest(self) -> float:
        """Highest resonance, Hz."""
        return max(mode.frequency for axis in self.axes for mode in axis.modes)

    @property
    def resonance(self) -> float:
        """Lowest resonance, Hz."""
        return min(mode.frequency for axis in self.axes for mode in axis.modes)

    def at_rest(self) -> TubeState:
        """Return the state of a scanner that was never driven."""
        x, y = self.axes
        return TubeState(
            (x.hysteresis.at_rest(), y.hysteresis.at_rest()),
            (x.dynamics.at_rest(), y.dynamics.at_rest()),
            (0.0, 0.0),
            0.0,
        )

    def advance(
        self, state: TubeState, drive: Array, sample_period: float
    ) -> tuple[TubeState, Array]:
        """State after a block, and where the tip is over the sample (m); both arrays (2, n).

        A drive sample (V) is held for ``sample_period`` (s). Its place is the mean of those at both
        ends of that time, so that it lags by nothing but the physics.
        """
        parts = [
            self._axis(k, state, drive[k] * (DRAWN_FOR / self.upper), sample_period)
            for k in range(2)
        ]
        (memory_x, sections_x, x), (memory_y, sections_y, y) = parts
        after = TubeState(
            (memory_x, memory_y),
            (sections_x, sections_y),
            (float(x[-1]), float(y[-1])),
            state.time + sample_period * drive.shape[1],
        )
        own = 0.5 * (np.stack([x[1:], y[1:]]) + np.stack([x[:-1], y[:-1]]))
        seconds = state.time + sample_period * (0.5 + np.arange(drive.shape[1]))
        gone = self.settling * -np.expm1(-seconds / self.settling)
        return after, np.stack(
            [
                own[0] + self.coupling[0] * own[1] + self.drift[0] * gone,
                own[1] + self.coupling[1] * own[0] + self.drift[1] * gone,
            ]
        )

    def _axis(
        self, k: int, state: TubeState, drive: Array, sample_period: float
    ) -> tuple[Any, ComplexArray, Array]:
        """State of the hysteresis, sections, and places from the block's start to its end."""
        axis = self.axes[k]
        memory, force = axis.hysteresis.advance(state.hysteresis[k], drive)
        sections, before = axis.dynamics.apply(state.sections[k], force, sample_period)
        end = float(np.sum((axis.dynamics.gains * sections).real))
        return memory, sections, axis.gain * np.append(before, end)


def draw_tube(rng: np.random.Generator, family: str | None = None) -> TubeScanner:
    """Draw a scanner: 300 Hz to 3 kHz, drives to ±10 to ±200 V, 10 to 100 µm.

    The controller's sensitivities are wrong by up to 10 %. Each axis draws a family of its own
    where none is given.
    """
    reach, upper = _log(rng, 10e-6, 100e-6), _log(rng, 10.0, 200.0)
    resonance = _log(rng, 300.0, 3000.0)
    reaches = reach, reach * rng.uniform(0.9, 1.1)
    frequencies = resonance, resonance * rng.uniform(0.85, 1.15)
    x, y = (
        _axis(rng, family or str(rng.choice(FAMILIES)), frequency, own)
        for frequency, own in zip(frequencies, reaches, strict=True)
    )
    return TubeScanner(
        axes=(x, y),
        upper=upper,
        reach=reaches,
        coupling=_pair(rng, 0.02),
        drift=_pair(rng, 3e-9),
        settling=_log(rng, 300.0, 10_000.0),
        nominal=(
            reaches[0] / (2.0 * upper) * float(rng.uniform(0.9, 1.1)),
            reaches[1] / (2.0 * upper) * float(rng.uniform(0.9, 1.1)),
        ),
    )


def _axis(rng: np.random.Generator, family: str, resonance: float, reach: float) -> TubeAxis:
    """Draw an axis that goes ``reach`` (m) from end to end, once it has been at both."""
    operator = hysteresis(rng, family)
    share = float(rng.uniform(0.0, 0.06))
    modes = (
        Mode(resonance, _log(rng, 0.005, 0.05), 1.0 - share),
        Mode(resonance * float(rng.uniform(1.8, 2.8)), _log(rng, 0.005, 0.05), share),
    )
    creep = tuple(
        (float(rng.uniform(0.003, 0.012)), tau * float(rng.uniform(0.6, 1.6))) for tau in TAUS
    )
    cycle = loop(operator)[1]
    gain = reach / float(np.ptp(cycle))
    return TubeAxis(family, operator, dynamics(modes, creep), modes, creep, gain)


def loop(operator: Mapped) -> tuple[Array, Array]:
    """Drive (V) and output (V) of the largest loop, once both ends have been reached; both (n,)."""
    swing = np.linspace(-DRAWN_FOR, DRAWN_FOR, 2001)
    drive = np.concatenate([swing[1000:], swing[::-1], swing, swing[::-1]])
    return drive[-4002:], applied(operator, drive)[-4002:]


def dynamics(modes: tuple[Mode, ...], creep: tuple[tuple[float, float], ...]) -> Dynamics:
    """Modes in parallel, then creep V(s) (1 + sum g / (1 + s tau)), of gain 1 before it creeps."""
    poles = np.array([_pole(mode) for mode in modes])
    residues = np.array([_residue(mode) for mode in modes])
    slow = np.array([-1.0 / tau for _, tau in creep])
    gains = np.array([gain for gain, _ in creep])

    def creeping(s: ComplexArray) -> ComplexArray:
        return 1.0 + np.sum(gains / (1.0 - s[:, None] / slow), axis=1)

    at_slow = 2.0 * _static(poles, residues, slow)
    fast_gains = -2.0 * residues * creeping(poles) / poles
    return Dynamics(np.append(poles, slow), np.append(fast_gains, gains * at_slow))


def _static(poles: ComplexArray, residues: ComplexArray, at: Array) -> Array:
    """Half of the modes' response on the real axis."""
    apart = residues / (at[:, None] - poles)
    return np.asarray(np.sum(apart.real, axis=1))


def _pole(mode: Mode) -> complex:
    omega = 2.0 * np.pi * mode.frequency
    return complex(-mode.damping * omega, omega * np.sqrt(1.0 - mode.damping**2))


def _residue(mode: Mode) -> complex:
    """Residue of share omega^2 / (s^2 + 2 zeta omega s + omega^2) at its upper pole."""
    omega = 2.0 * np.pi * mode.frequency
    return complex(mode.share * omega**2 / (2j * _pole(mode).imag))


def _pair(rng: np.random.Generator, most: float) -> tuple[float, float]:
    x, y = rng.uniform(-most, most, 2)
    return float(x), float(y)


def _log(rng: np.random.Generator, lowest: float, highest: float) -> float:
    return float(np.exp(rng.uniform(np.log(lowest), np.log(highest))))
