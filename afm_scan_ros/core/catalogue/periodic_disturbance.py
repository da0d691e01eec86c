"""Periodic disturbance: the scanner moves at a frequency of its own, driven or not.

Equation: x(t) = x₀(t) + Σₖ aₖ cos(2π k f t) + bₖ sin(2π k f t), t from the record's first sample;
aₖ and bₖ in m, f in Hz; one tone, or as many harmonics as hum has. Or the same in V on the drive,
before the hysteresis, whose gain for it is another while the scanner runs and where it turns.
Sources: a pump, a fan, an acoustic mode of the room; the mains and what rectifies them.
"""

from collections.abc import Iterable, Iterator, Sequence
from functools import partial

import numpy as np
from attrs import frozen
from scipy.optimize import minimize_scalar

from afm_scan_ros.core.catalogue.amounts import amounts
from afm_scan_ros.core.catalogue.entry import Entry, Form, Parameter
from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.tracing.clues import Clues, prominent_lines
from afm_scan_ros.core.types import Array

FREQUENCY = Parameter("frequency", "Hz", 0.01, 5e4, 1e-6)


def _tone(unit: str, most: float, harmonic: str = "") -> tuple[Parameter, Parameter]:
    """Amplitudes of a cosine and a sine, in which each record begins at another phase."""
    cosine, sine = (f"{part}{harmonic}" for part in ("cosine", "sine"))
    step = 1e-7 * most
    return (
        Parameter(cosine, unit, -most, most, step, own=True),
        Parameter(sine, unit, -most, most, step, own=True),
    )


HARMONICS = tuple(range(2, 7))


def _hum(unit: str, most: float) -> tuple[Parameter, ...]:
    further = (each for k in HARMONICS for each in _tone(unit, most, f"_{k}"))
    return (*_tone(unit, most), FREQUENCY, *further)


TONE = (*_tone("m", 1e-5), FREQUENCY)
HUM, DRIVEN_HUM = _hum("m", 1e-5), _hum("V", 1.0)
NO_HUM = (0.0, 0.0, 50.0, *(0.0 for _ in HUM[3:]))
LINES = 3
MORE = 1.2
"""Times the height of a comb that one of half its spacing must have, to be more than the same."""
APART = 2.0
"""Periods in a record by which two lines must differ to be two."""


@frozen
class Disturbance:
    """Motion, or volts, with time, which an inverse leaves alone; state: index of the next sample.

    At what phase the next scan will meet it nobody knows, so there is nothing to subtract.
    """

    cosine: float
    sine: float
    frequency: float
    sample_period: float

    def at_rest(self) -> int:
        """Index of the first sample."""
        return 0

    def apply(self, state: int, block: Array) -> tuple[int, Array]:
        """Signal with the disturbance, of one without, both (n,)."""
        after = state + len(block)
        time = self.sample_period * np.arange(state, after, dtype=np.float64)
        late = np.arctan2(self.sine, self.cosine)
        wave = np.cos(2.0 * np.pi * self.frequency * time - late)
        return after, block + np.hypot(self.cosine, self.sine) * wave

    def inverse_at_rest(self) -> None:
        """Return no state."""

    def invert(self, state: None, block: Array) -> tuple[None, Array]:  # noqa: ARG002 - Effect's
        """Return the targets unchanged."""
        return None, block

    def finish(self, state: None) -> Array:  # noqa: ARG002 - Effect's
        """Return nothing: no sample is ever owed."""
        return np.empty(0)


def insert(chain: Chain, values: Array) -> Chain:
    """Disturb the output: amplitudes (m) of cosine and sine, frequency (Hz)."""
    cosine, sine, frequency = values
    return chain.with_output(lambda period: Disturbance(cosine, sine, frequency, period))


def insert_hum(chain: Chain, values: Array) -> Chain:
    """Disturb the output by a tone as ``insert`` does, and by the amplitudes of its harmonics."""
    for tone in _tones(values):
        chain = insert(chain, tone)
    return chain


def insert_driven(chain: Chain, values: Array) -> Chain:
    """Disturb the drive: amplitudes in V."""
    for cosine, sine, frequency in _tones(values):
        tone = partial(Disturbance, cosine, sine, frequency)
        chain = chain.with_drive(tone)
    return chain


def _tones(values: Array) -> Iterator[Array]:
    """Cosine, sine and frequency of each harmonic."""
    yield values[:3]
    for k, (cosine, sine) in zip(HARMONICS, values[3:].reshape(-1, 2), strict=True):
        yield np.array([cosine, sine, k * values[2]])


def starts(clues: Clues) -> Iterator[tuple[float, ...]]:
    """The residual's lines, with their amplitudes."""
    for line in clues.prominent[:LINES] or (50.0,):
        yield _nearest(TONE, (*_amounts(clues, line, 1), line))


def starts_of_hum(clues: Clues) -> Iterator[tuple[float, ...]]:
    """The residual's largest line as the first harmonic, or as the second where that tells more.

    None where the drive repeats at that rate, for whatever the model lacks then has such
    harmonics, nor where the record holds too few periods to tell.
    """
    for line in clues.prominent[:1]:
        refined = _refined(clues, line)
        whole, half = (_comb(clues, f) for f in (refined, refined / 2.0))
        odd = np.linalg.norm(half) > MORE * np.linalg.norm(whole)
        frequency, found = (refined / 2.0, half) if odd else (refined, whole)
        if frequency * clues.duration > APART and not _driven(clues, frequency):
            yield _nearest(HUM, (*found[:2], frequency, *found[2:]))


def starts_of_driven(clues: Clues) -> Iterator[tuple[float, ...]]:
    """The same in volts, by the gain of the record as a whole."""
    gain = np.std(clues.displacement) / np.std(clues.drive) if np.ptp(clues.drive) > 0.0 else np.inf
    for hum in starts_of_hum(clues):
        volts = np.array(hum) / gain
        yield _nearest(DRIVEN_HUM, (*volts[:2], hum[2], *volts[3:]))


def _nearest(parameters: Sequence[Parameter], values: Iterable[float]) -> tuple[float, ...]:
    return tuple(p.nearest(value) for p, value in zip(parameters, values, strict=True))


def _refined(clues: Clues, frequency: float) -> float:
    """Where between its neighbours a line is highest; its harmonics are off by as many times."""
    near = 1.0 / clues.duration
    found = minimize_scalar(
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


def _comb(clues: Clues, frequency: float) -> Array:
    return _amounts(clues, frequency, 1, *HARMONICS)


def _amounts(clues: Clues, frequency: float, *harmonics: int) -> Array:
    """Cosine and sine of each harmonic in the residual, one after the other, m."""
    time = clues.sample_period * np.arange(len(clues.residual), dtype=np.float64)
    phases = [2.0 * np.pi * k * frequency * time for k in harmonics]
    waves = (wave(phase) for phase in phases for wave in (np.cos, np.sin))
    return amounts(clues.residual, *waves)


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
        Form("", TONE, insert, starts, (0.0, 0.0, 50.0)),
        Form("hum", HUM, insert_hum, starts_of_hum, NO_HUM),
        Form("driven_hum", DRIVEN_HUM, insert_driven, starts_of_driven, NO_HUM),
    ),
)
