"""Periodic disturbance: the scanner moves at a frequency of its own, driven or not.

x(t) = x₀(t) + Σₖ aₖ cos(2π k f t) + bₖ sin(2π k f t). t begins at the record's first sample. aₖ and
bₖ are in m, f is in Hz:

- one tone: k = 1. Causes: a pump, a fan, an acoustic mode of the room.
- hum: six harmonics. Causes: the mains and its rectifiers.
- comb: sixteen harmonics. Cause: an impact on the frame once a turn.
- driven_hum: hum in V on the drive, before the hysteresis, whose gain for it changes while the
  scanner moves and where it turns.

The amplitudes differ between records, as each record begins at another phase.
"""

from collections.abc import Iterator

import numpy as np
import scipy
from attrs import frozen
from numpy.typing import NDArray

from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.compiled import compiled
from afm_scan_ros.core.effects.base import CausalInverse, Element
from afm_scan_ros.core.effects.effect_type import (
    EffectForm,
    EffectParameter,
    EffectType,
    Starts,
    register,
)
from afm_scan_ros.core.effects.residual_features import ResidualFeatures, prominent_lines
from afm_scan_ros.core.types import Array

Harmonics = NDArray[np.complex128]
FREQUENCY = EffectParameter("frequency", "Hz", 0.01, 5e4, 1e-6, neutral=50.0, located=True)
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

    A stretch at once, by Horner's rule, real and imaginary parts apart, for vector instructions.
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


@frozen
class Disturbance(CausalInverse):
    """Motion, or volts, with time, which an inverse leaves alone; state: index of the next sample.

    ``harmonics`` are aₖ - j bₖ, from the first on. Their phase in the next scan is unknown.
    """

    harmonics: tuple[complex, ...]
    frequency: float
    sample_period: float

    def at_rest(self) -> int:
        """Index of the first sample."""
        return 0

    def apply(self, state: int, block: Array) -> tuple[int, Array]:
        """Signal with the disturbance, of one without, both (n,)."""
        moved, turn = block.copy(), 2.0 * np.pi * self.frequency * self.sample_period
        _move(np.array(self.harmonics), turn, state, moved)
        return state + len(block), moved

    def invert(self, state: int, block: Array) -> tuple[int, Array]:
        """Return the targets unchanged."""
        return state, block


def insert(chain: Chain, values: Array) -> Chain:
    """Disturb the output: amplitudes (m) of cosine and sine, frequency (Hz), further harmonics."""
    return chain.with_output(Element(Disturbance, _waves(values)))


def insert_driven(chain: Chain, values: Array) -> Chain:
    """Disturb the drive: amplitudes in V."""
    return chain.with_drive(Element(Disturbance, _waves(values)))


def _waves(values: Array) -> tuple[tuple[complex, ...], float]:
    cosine, sine = np.delete(values, 2).reshape(-1, 2).T
    return tuple((cosine - 1j * sine).tolist()), float(values[2])


def starts(features: ResidualFeatures) -> Iterator[tuple[float, ...]]:
    """The residual's lines, with their amplitudes."""
    for line in features.prominent[:LINES] or (50.0,):
        yield _values(line, _amounts(features, line, 1), MOST_M)


def starts_of_comb(harmonics: int) -> Starts:
    """Starts of a disturbance with so many harmonics."""

    def starts(features: ResidualFeatures) -> Iterator[tuple[float, ...]]:
        """The comb that explains most of the residual and contains its largest line.

        None where the drive repeats at that rate, for whatever the model lacks then has such
        harmonics, nor where the record holds too few periods to identify them.
        """
        for line in features.prominent[:1]:
            frequency = _fundamental(features, _refined(features, line))
            if frequency * features.duration > APART and not _driven(features, frequency):
                yield _values(frequency, _amounts(features, frequency, harmonics), MOST_M)

    return starts


def starts_of_driven(features: ResidualFeatures) -> Iterator[tuple[float, ...]]:
    """Hum in volts, by the gain of the record as a whole."""
    gain = (
        np.std(features.displacement) / np.std(features.drive)
        if np.ptp(features.drive) > 0.0
        else np.inf
    )
    for hum in starts_of_comb(HUM)(features):
        yield _values(hum[2], np.delete(hum, 2) / gain, MOST_V)


def _values(frequency: float, found: Array, most: float) -> tuple[float, ...]:
    """A form's values: cosine and sine, the frequency, and those of further harmonics."""
    cosine, sine, *further = np.clip(found, -most, most).tolist()
    return cosine, sine, FREQUENCY.nearest(frequency), *further


def _fundamental(features: ResidualFeatures, line: float) -> float:
    """Highest fundamental frequency of which a line is a harmonic and that explains as much."""
    found, height = line, 0.0
    for number in range(1, HUM + 1):
        tried = float(np.linalg.norm(_amounts(features, line / number, HUM)))
        if tried > MORE * height:
            found, height = line / number, tried
    return found


def _refined(features: ResidualFeatures, frequency: float) -> float:
    """Where between its neighbours a line is highest; its harmonics are off by as many times."""
    near = 1.0 / features.duration
    found = scipy.optimize.minimize_scalar(
        lambda f: -float(np.linalg.norm(_amounts(features, f, 1))),
        bounds=(frequency - near, frequency + near),
        method="bounded",
        options={"xatol": 1e-2 * near},
    )
    return float(found.x)


def _driven(features: ResidualFeatures, frequency: float) -> bool:
    """Whether a line of the drive lies at a frequency, within the record's resolution."""
    lines = prominent_lines(features.drive, features.sample_period, most=None)
    return any(abs(line - frequency) * features.duration < APART for line in lines)


def _amounts(features: ResidualFeatures, frequency: float, harmonics: int) -> Array:
    """Cosine and sine of each harmonic in the residual, m: at right angles over many periods.

    One above half the sample rate would be another's alias, and is none.
    """
    count, found = len(features.residual), []
    turn = np.exp(2j * np.pi * frequency * features.sample_period * np.arange(count))
    wave, residual = turn, 2.0 / count * (features.residual - features.residual.mean())
    for _ in range(harmonics):
        found.append(residual @ wave)
        wave = wave * turn
    apart = 2.0 * frequency * features.sample_period * np.arange(1, harmonics + 1) < 1.0
    return np.where(apart, found, 0.0).view(np.float64)


def _parameters(harmonics: int, unit: str, most: float) -> tuple[EffectParameter, ...]:
    """Amplitudes of cosines and sines, in which each record begins at another phase."""
    numbers = ("", *(f"_{k}" for k in range(2, harmonics + 1)))
    cosine, sine, *further = (
        EffectParameter(f"{part}{number}", unit, -most, most, 1e-7 * most, own=True)
        for number in numbers
        for part in ("cosine", "sine")
    )
    return cosine, sine, FREQUENCY, *further


def _form(
    kind: str,
    harmonics: int,
    starts: Starts,
    example: tuple[float, ...],
    refines: str | None = None,
) -> EffectForm:
    """Return the form of so many harmonics of the displacement."""
    text = "" if kind else "one tone"
    where, what = ("output",), _parameters(harmonics, "m", MOST_M)
    return EffectForm(
        kind, where, what, insert, starts, example=example, text=text, refines=refines
    )


MOVED = (3e-8, -4e-8, 50.0, 2e-8, 1e-8, 0.0, 1e-8, -1e-8, 0.0, 5e-9, 0.0, 0.0, 3e-9)
DRIVEN = (1e-2, -2e-2, 50.0, 2e-3, 1e-3, 0.0, 1e-3, -1e-3, 0.0, 5e-4, 0.0, 0.0, 3e-4)
"""Examples of a hum, as a displacement (m) and as a drive (V)."""
FORMS = (
    _form("", 1, starts, (3e-8, -4e-8, 50.0)),
    _form("hum", HUM, starts_of_comb(HUM), MOVED),
    EffectForm(
        "driven_hum",
        ("drive",),
        _parameters(HUM, "V", MOST_V),
        insert_driven,
        starts_of_driven,
        example=DRIVEN,
    ),
    _form("comb", COMB, starts_of_comb(COMB), (3e-8, -4e-8, 20.0, *30 * (1e-9,)), refines="hum"),
)


@register
def periodic_disturbance() -> EffectType:
    """Describe the effect."""
    return EffectType(
        name="periodic_disturbance",
        equation="x = x0 + cosine cos(2 pi frequency t) + sine sin(2 pi frequency t), or with its"
        " harmonics, cosine_2 cos(4 pi frequency t) and on, or these added to u",
        needs="a record of many periods; best one at rest, where nothing else moves",
        experiment="rest",
        remedy="none",
        advice="its phase in the next scan is unknown. Find its source and remove it, or lock the"
        " line rate to it, so that its phase is the same in each line",
        source="A Fourier series of the period of the disturbance.",
        inverse="The inverse leaves it alone: its phase differs in the next scan.",
        forms=FORMS,
    )
