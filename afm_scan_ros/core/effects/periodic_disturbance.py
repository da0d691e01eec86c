"""Periodic disturbance: the scanner moves at a frequency of its own, driven or not.

Equation: x(t) = x₀(t) + Σₖ aₖ cos(2π k f t) + bₖ sin(2π k f t), t from the record's first sample;
aₖ and bₖ in m, f in Hz; one tone, as many harmonics as hum has, or a comb of more. Or hum in V on
the drive, before the hysteresis, whose gain for it is another while the scanner runs and where it
turns. Sources: a pump, a fan, an acoustic mode of the room; the mains and what rectifies them; of a
comb, what knocks at the frame with every turn.
"""

from collections.abc import Callable, Iterator

import numpy as np
import scipy
from attrs import frozen
from numpy.typing import NDArray

from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.compiled import compiled
from afm_scan_ros.core.diagnosis.clues import Clues, prominent_lines
from afm_scan_ros.core.effects.entry import Entry, Form, Parameter
from afm_scan_ros.core.types import Array

Harmonics = NDArray[np.complex128]
FREQUENCY = Parameter("frequency", "Hz", 0.01, 5e4, 1e-6)
MOST_M, MOST_V = 1e-5, 1.0
HUM, COMB = 6, 16
"""Harmonics, the first included: of a hum, by which a comb is found too, and of a comb."""
STRETCH = 64
"""Samples."""
LINES = 3
MORE = 1.2
"""Times the height of a comb that one of closer teeth must have, to be more than the same."""
APART = 2.0
"""Periods in a record by which two lines must differ to be two."""


@compiled
def _move(harmonics: Harmonics, turn: float, first: int, signal: Array) -> None:
    """Add the harmonics to a signal, of which each sample is later by ``turn`` (rad).

    A stretch at once, by Horner's rule, its real and imaginary parts apart: so the machine takes
    several samples together. Stretches begin where they do for any cut into blocks.
    """
    near, n = np.exp(1j * turn * np.arange(STRETCH)), 0
    real, imaginary = np.empty(STRETCH), np.empty(STRETCH)
    while n < signal.size:
        begin = (first + n) // STRETCH * STRETCH
        wave = np.exp(1j * turn * begin) * near
        cosine, sine = wave.real.copy(), wave.imag.copy()
        real[:], imaginary[:] = 0.0, 0.0
        for k in range(harmonics.size - 1, -1, -1):
            along, across = harmonics[k].real, harmonics[k].imag
            for m in range(STRETCH):
                x, y = real[m] + along, imaginary[m] + across
                real[m] = x * cosine[m] - y * sine[m]
                imaginary[m] = x * sine[m] + y * cosine[m]
        last = min(signal.size, begin + STRETCH - first)
        for m in range(n, last):
            signal[m] += real[first + m - begin]
        n = last


@frozen(eq=False)
class Disturbance:
    """Motion, or volts, with time, which an inverse leaves alone; state: index of the next sample.

    ``harmonics`` (k,) are aₖ - j bₖ, from the first on. At what phase the next scan will meet it
    nobody knows, so there is nothing to subtract.
    """

    harmonics: Harmonics
    frequency: float
    sample_period: float

    def at_rest(self) -> int:
        """Index of the first sample."""
        return 0

    def apply(self, state: int, block: Array) -> tuple[int, Array]:
        """Signal with the disturbance, of one without, both (n,)."""
        moved, turn = block.copy(), 2.0 * np.pi * self.frequency * self.sample_period
        _move(self.harmonics, turn, state, moved)
        return state + len(block), moved

    def inverse_at_rest(self) -> None:
        """Return no state."""

    def invert(self, state: None, block: Array) -> tuple[None, Array]:  # noqa: ARG002 - Effect's
        """Return the targets unchanged."""
        return None, block

    def finish(self, state: None) -> Array:  # noqa: ARG002 - Effect's
        """Return nothing: no sample is ever owed."""
        return np.empty(0)


def insert(chain: Chain, values: Array) -> Chain:
    """Disturb the output: amplitudes (m) of cosine and sine, frequency (Hz), further harmonics."""
    harmonics, frequency = _waves(values)
    return chain.with_output(lambda period: Disturbance(harmonics, frequency, period))


def insert_driven(chain: Chain, values: Array) -> Chain:
    """Disturb the drive: amplitudes in V."""
    harmonics, frequency = _waves(values)
    return chain.with_drive(lambda period: Disturbance(harmonics, frequency, period))


def _waves(values: Array) -> tuple[Harmonics, float]:
    cosine, sine = np.delete(values, 2).reshape(-1, 2).T
    return cosine - 1j * sine, float(values[2])


def starts(clues: Clues) -> Iterator[tuple[float, ...]]:
    """The residual's lines, with their amplitudes."""
    for line in clues.prominent[:LINES] or (50.0,):
        yield _values(line, _amounts(clues, line, 1), MOST_M)


def starts_of_comb(harmonics: int) -> Callable[[Clues], Iterator[tuple[float, ...]]]:
    """Starts of a disturbance with so many harmonics."""

    def starts(clues: Clues) -> Iterator[tuple[float, ...]]:
        """The comb that tells most of the residual, its largest line among the teeth.

        None where the drive repeats at that rate, for whatever the model lacks then has such
        harmonics, nor where the record holds too few periods to tell.
        """
        for line in clues.prominent[:1]:
            frequency = _fundamental(clues, _refined(clues, line))
            if frequency * clues.duration > APART and not _driven(clues, frequency):
                yield _values(frequency, _amounts(clues, frequency, harmonics), MOST_M)

    return starts


def starts_of_driven(clues: Clues) -> Iterator[tuple[float, ...]]:
    """Hum in volts, by the gain of the record as a whole."""
    gain = np.std(clues.displacement) / np.std(clues.drive) if np.ptp(clues.drive) > 0.0 else np.inf
    for hum in starts_of_comb(HUM)(clues):
        yield _values(hum[2], np.delete(hum, 2) / gain, MOST_V)


def _values(frequency: float, found: Array, most: float) -> tuple[float, ...]:
    """A form's values: cosine and sine, the frequency, and those of further harmonics."""
    cosine, sine, *further = np.clip(found, -most, most).tolist()
    return cosine, sine, FREQUENCY.nearest(frequency), *further


def _fundamental(clues: Clues, line: float) -> float:
    """Frequency of which a line is one of the harmonics: the highest that tells as much."""
    found, height = line, 0.0
    for number in range(1, HUM + 1):
        tried = float(np.linalg.norm(_amounts(clues, line / number, HUM)))
        if tried > MORE * height:
            found, height = line / number, tried
    return found


def _refined(clues: Clues, frequency: float) -> float:
    """Where between its neighbours a line is highest; its harmonics are off by as many times."""
    near = 1.0 / clues.duration
    found = scipy.optimize.minimize_scalar(
        lambda f: -float(np.linalg.norm(_amounts(clues, f, 1))),
        bounds=(frequency - near, frequency + near),
        method="bounded",
        options={"xatol": 1e-2 * near},
    )
    return float(found.x)


def _driven(clues: Clues, frequency: float) -> bool:
    """Whether a line of the drive lies at a frequency, as near as the record's length tells."""
    lines = prominent_lines(clues.drive, clues.sample_period, most=None)
    return any(abs(line - frequency) * clues.duration < APART for line in lines)


def _amounts(clues: Clues, frequency: float, harmonics: int) -> Array:
    """Cosine and sine of each harmonic in the residual, one after the other, m.

    Over many periods they are at right angles to each other, so each is measured alone. One above
    half the sample rate would be another's alias, and is none.
    """
    count, found = len(clues.residual), []
    turn = np.exp(2j * np.pi * frequency * clues.sample_period * np.arange(count))
    wave, residual = turn, 2.0 / count * (clues.residual - clues.residual.mean())
    for _ in range(harmonics):
        found.append(residual @ wave)
        wave = wave * turn
    apart = 2.0 * frequency * clues.sample_period * np.arange(1, harmonics + 1) < 1.0
    return np.where(apart, found, 0.0).view(np.float64)


def _parameters(harmonics: int, unit: str, most: float) -> tuple[Parameter, ...]:
    """Amplitudes of cosines and sines, in which each record begins at another phase."""
    numbers = ("", *(f"_{k}" for k in range(2, harmonics + 1)))
    cosine, sine, *further = (
        Parameter(f"{part}{number}", unit, -most, most, 1e-7 * most, own=True)
        for number in numbers
        for part in ("cosine", "sine")
    )
    return cosine, sine, FREQUENCY, *further


def _none(harmonics: int) -> tuple[float, ...]:
    return _values(50.0, np.zeros(2 * harmonics), 0.0)


TONE, HUM_M, COMB_M = (_parameters(count, "m", MOST_M) for count in (1, HUM, COMB))
HUM_V = _parameters(HUM, "V", MOST_V)

ENTRY = Entry(
    name="periodic_disturbance",
    equation="x = x0 + cosine cos(2 pi frequency t) + sine sin(2 pi frequency t), or with its"
    " harmonics, cosine_2 cos(4 pi frequency t) and on, or these added to u",
    needs="a record of many periods; best one at rest, where nothing else moves",
    confusable=("drift", "extra_resonance"),
    experiment="rest",
    remedy="none",
    advice="its phase is unknown when the next scan begins: find its source and remove it, or lock"
    " the line rate to it, so that each line meets it alike",
    forms=(
        Form("", TONE, insert, starts, _none(1)),
        Form("hum", HUM_M, insert, starts_of_comb(HUM), _none(HUM)),
        Form("driven_hum", HUM_V, insert_driven, starts_of_driven, _none(HUM)),
        Form("comb", COMB_M, insert, starts_of_comb(COMB), _none(COMB), refines="hum"),
    ),
    words={"": "one tone"},
)
