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
from afm_scan_ros.simulation.axis import ComplexArray, Dynamics

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
    """What a scanner remembers of each axis: its hysteresis and its sections; and its age (s)."""

    hysteresis: tuple[Any, Any]
    sections: tuple[ComplexArray, ComplexArray]
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
            0.0,
        )

    def advance(
        self, state: TubeState, drive: Array, sample_period: float
    ) -> tuple[TubeState, Array]:
        """State after a block, and the tip's place over the sample (m); both arrays (2, n).

        A drive sample (V) is held for ``sample_period`` (s); its place is that just before.
        """
        scaled = drive * (DRAWN_FOR / self.upper)
        own = np.empty_like(drive)
        memories, sections = [], []
        for k, axis in enumerate(self.axes):
            memory, force = axis.hysteresis.advance(state.hysteresis[k], scaled[k])
            driven: Array = np.asarray(axis.gain * force, dtype=np.float64)
            section, moved = axis.dynamics.apply(state.sections[k], driven, sample_period)
            own[k] = moved
            memories.append(memory)
            sections.append(section)
        seconds = np.asarray(state.time + sample_period * np.arange(drive.shape[1]), float)
        end = state.time + sample_period * drive.shape[1]
        after = TubeState((memories[0], memories[1]), (sections[0], sections[1]), end)
        return after, self._over_sample(own, seconds)

    def place(self, state: TubeState) -> Array:
        """Tip's place over the sample (m) in a state, (2,)."""
        pairs = zip(self.axes, state.sections, strict=True)
        own = np.array([float(np.sum((a.dynamics.gains * z).real)) for a, z in pairs])
        return self._over_sample(own[:, np.newaxis], np.array([state.time]))[:, 0]

    def _over_sample(self, own: Array, seconds: Array) -> Array:
        """Add coupling and drift to the axes' own places (m), (2, n)."""
        gone = self.settling * -np.expm1(-seconds / self.settling)
        crossed = np.reshape(self.coupling, (2, 1)) * own[::-1]
        return np.asarray(own + crossed + np.outer(self.drift, gone))


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

    creeping = 1.0 + np.sum(gains / (1.0 - poles[:, None] / slow), axis=1)
    responding = 2.0 * np.sum((residues / (slow[:, None] - poles)).real, axis=1)
    return Dynamics(
        np.append(poles, slow),
        np.append(-2.0 * residues * creeping / poles, gains * responding),
    )


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
