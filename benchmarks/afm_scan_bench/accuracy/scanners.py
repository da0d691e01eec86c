"""Scanners drawn at random, their resonance identified from records as labs make them.

One mode or two, 150 Hz to 20 kHz, damping ratios 0.003 to 0.1, drives of 1 to 150 V, ranges of 1 to
100 µm, 0.5 to 5 nm of sensor noise, hum of 0 to 30 nm. The drive is a multisine, a sweep, noise or
steps, of a twentieth of the drive's range. The dynamics are scipy's discretisation of each mode
behind a hold; there is no hysteresis and no creep. The resonance is the mode that peaks highest.
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress

import numpy as np
from attrs import frozen
from scipy import signal

import afm_scan_ros as afm
from afm_scan_bench.accuracy.coverage import StatedInterval
from afm_scan_bench.scans import SEED
from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.types import Array
from afm_scan_ros.report.table import Row, Table

CASES = 40
SMALL = 0.05
"""Peak of the drive, over the drive's range."""
LENGTH = 40.0
"""Of a record, in 1 / (ζ f) of its slowest mode."""
CLOSE = 1e-3
"""Relative error of a resonance that counts as identified."""

COLUMNS = {
    "protocol": ("drive", ""),
    "cases": ("scanners", ".0f"),
    "refused": ("refused", ".0f"),
    "unknown": ("resonance unknown", ".0f"),
    "close_percent": ("resonance within 0.1 %, %", ".1f"),
    "inside_percent": ("inside its 95 % interval, %", ".1f"),
    "median_error_percent": ("median error, %", ".5f"),
    "largest_error_percent": ("largest error, %", ".4f"),
}


@frozen
class LinearMode:
    """A mode: frequency (Hz), damping ratio and its share of the gain at rest (m/V)."""

    frequency: float
    damping: float
    gain: float

    @property
    def peak(self) -> float:
        """Height of the response at resonance, m/V."""
        return self.gain / (2.0 * self.damping)

    def moved(self, drive: Array, sample_period: float) -> Array:
        """Displacement (m), (n,), under a held drive (V), (n,), sampled before each update."""
        omega = 2.0 * np.pi * self.frequency
        continuous = [self.gain * omega**2], [1.0, 2.0 * self.damping * omega, omega**2]
        b, a, _ = signal.cont2discrete(continuous, sample_period)
        return np.asarray(signal.lfilter(b[0], a, drive))


@frozen
class LinearScanner:
    """What is drawn of a scanner; ``noise`` and ``hum`` (its size) in m, ``limit`` in V."""

    modes: tuple[LinearMode, ...]
    limit: float
    noise: float
    hum: float
    mains: float
    """Hz"""

    @property
    def first(self) -> LinearMode:
        """The mode that peaks highest."""
        return max(self.modes, key=lambda mode: mode.peak)


def drawn(rng: np.random.Generator) -> LinearScanner:
    """Draw a scanner."""

    def between(low: float, high: float) -> float:
        return float(np.exp(rng.uniform(np.log(low), np.log(high))))

    limit, travel = between(1.0, 150.0), between(1e-6, 1e-4)
    gain, frequency = travel / limit, between(150.0, 2e4)
    modes = [LinearMode(frequency, between(0.003, 0.1), gain)]
    if rng.random() < 0.5:  # noqa: PLR2004 - as often as not
        further = between(1.4, 3.0) * frequency
        modes.append(LinearMode(further, between(0.003, 0.1), between(0.03, 0.3) * gain))
    mains = float(rng.choice([50.0, 60.0])) * (1.0 + 1e-3 * rng.uniform(-1.0, 1.0))
    noise, hum = between(0.5e-9, 5e-9), rng.uniform(0.0, 30e-9)
    return LinearScanner(tuple(modes), limit, noise, hum, mains)


def rate_of(scanner: LinearScanner) -> float:
    """Sample rate, Hz."""
    return 12.0 * max(mode.frequency for mode in scanner.modes)


def highest_of(scanner: LinearScanner) -> float:
    """Highest frequency driven, Hz."""
    return 1.5 * max(mode.frequency for mode in scanner.modes)


def samples_of(scanner: LinearScanner) -> int:
    """Length of a record."""
    slowest = min(mode.damping * mode.frequency for mode in scanner.modes)
    return int(LENGTH / slowest * rate_of(scanner))


def multisine(scanner: LinearScanner, rng: np.random.Generator) -> Array:
    """Three draws of the phases, four periods each."""
    period = samples_of(scanner) // 12
    lines = np.arange(2, int(highest_of(scanner) / rate_of(scanner) * period))
    spectrum = np.zeros((3, period // 2 + 1), dtype=np.complex128)
    spectrum[:, lines] = np.exp(2j * np.pi * rng.random((3, len(lines))))
    return np.tile(np.fft.irfft(spectrum, period)[:, np.newaxis], (1, 4, 1)).ravel()


def sweep(scanner: LinearScanner, rng: np.random.Generator) -> Array:  # noqa: ARG001 - as the others
    """One sine whose frequency rises evenly in logarithm."""
    count, rate, highest = samples_of(scanner), rate_of(scanner), highest_of(scanner)
    time = np.arange(count) / rate
    return np.asarray(signal.chirp(time, highest / 300.0, time[-1], highest, "log", phi=-90))


def noise(scanner: LinearScanner, rng: np.random.Generator) -> Array:
    """Noise below the highest frequency, from no rest to no rest."""
    band = signal.butter(6, 2.0 * highest_of(scanner) / rate_of(scanner))
    return np.asarray(signal.lfilter(*band, rng.standard_normal(samples_of(scanner))))


def steps(scanner: LinearScanner, rng: np.random.Generator) -> Array:
    """Forty steps to random levels."""
    levels = rng.uniform(-1.0, 1.0, 40)
    return np.repeat(levels, samples_of(scanner) // len(levels))


PROTOCOLS: dict[str, Callable[[LinearScanner, np.random.Generator], Array]] = {
    "multisine": multisine,
    "sweep": sweep,
    "noise": noise,
    "steps": steps,
}


def tried(protocol: str, seed: int) -> StatedInterval | None:
    """Draw a scanner, record and identify it; None where its resonance is unknown.

    Raises InputError or ScanError where the record is refused.
    """
    rng = np.random.default_rng(seed)
    scanner = drawn(rng)
    period = 1.0 / rate_of(scanner)
    drive = PROTOCOLS[protocol](scanner, rng)
    drive *= SMALL * scanner.limit / np.abs(drive).max()
    moved = sum(mode.moved(drive, period) for mode in scanner.modes)
    turn = 2.0 * np.pi * scanner.mains * period * np.arange(len(drive)) + rng.uniform(0.0, 6.0)
    measured = moved + scanner.hum * np.sin(turn) + scanner.noise * rng.standard_normal(len(drive))
    model = afm.identify([afm.Record(drive, measured, period, start="depolarised")])
    return StatedInterval.of(model.effects["x"].vibration, "resonance", scanner.first.frequency)


def measure(cases: int = CASES) -> Table:
    """Try so many scanners, as many of each protocol, and state how many come out."""
    rows = list(_rows(cases // len(PROTOCOLS)))
    title = "Resonance of scanners drawn at random"
    return Table("scanners", title, COLUMNS, rows)


def _rows(each: int) -> Iterator[Row]:
    for number, protocol in enumerate(PROTOCOLS):
        outcomes: list[StatedInterval | None] = []
        for seed in range(SEED + 1000 * number, SEED + 1000 * number + each):
            with suppress(InputError, ScanError):
                outcomes.append(tried(protocol, seed))
        yield {
            "protocol": protocol,
            "cases": each,
            "refused": each - len(outcomes),
            **summary(outcomes),
        }


def summary(outcomes: Sequence[StatedInterval | None]) -> Row:
    """Figures of scanners that were not refused."""
    stated = [outcome for outcome in outcomes if outcome]
    errors = np.abs([outcome.error for outcome in stated])
    return {
        "unknown": len(outcomes) - len(stated),
        "close_percent": 100.0 * float(np.mean(errors < CLOSE)),
        "inside_percent": 100.0 * float(np.mean([outcome.inside for outcome in stated])),
        "median_error_percent": 100.0 * float(np.median(errors)),
        "largest_error_percent": 100.0 * float(errors.max()),
    }
