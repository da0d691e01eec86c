"""Sets of records that labs take, of a drawn scanner: drives made without the product."""

from collections.abc import Callable, Sequence

import numpy as np
from scipy import signal

import afm_scan_ros as afm
from afm_scan_bench.any_lab.scanner import DrawnScanner
from afm_scan_ros.core.types import Array

Drive = tuple[str, Array, float]
"""Name, shape between -1 and 1 (n,), and samples a second."""
SAMPLES = 120_000
"""About as many samples as a record has."""


def _slow(scanner: DrawnScanner) -> float:
    """Frequency of motion that does not excite the resonance, Hz."""
    return scanner.resonance / 400.0


def _triangle(rate: float, frequency: float, cycles: int) -> Array:
    seconds = np.arange(round(cycles * rate / frequency)) / rate
    return np.asarray(signal.sawtooth(2.0 * np.pi * (frequency * seconds + 0.25), 0.5))


def multisine(scanner: DrawnScanner, rng: np.random.Generator) -> list[Drive]:
    """Waves with a flat spectrum to three times the resonance, eight periods."""
    period = 2 ** int(np.log2(SAMPLES / 8))
    highest = min(4.5 * scanner.resonance, 0.4 * scanner.rate)
    lines = np.arange(1, int(highest / scanner.rate * period))
    spectrum = np.zeros(period // 2 + 1, complex)
    spectrum[lines] = np.exp(2j * np.pi * rng.random(len(lines)))
    wave = np.fft.irfft(spectrum, period)
    return [("multisine", np.tile(0.3 * wave / np.abs(wave).max(), 8), scanner.rate)]


def sweep(scanner: DrawnScanner, rng: np.random.Generator) -> list[Drive]:
    """A logarithmic sweep through the resonance, faded in and out."""
    del rng
    seconds = np.arange(SAMPLES) / scanner.rate
    low, high = scanner.resonance / 10.0, min(4.0 * scanner.resonance, 0.4 * scanner.rate)
    wave = signal.chirp(seconds, low, seconds[-1], high, "logarithmic", -90.0)
    rest = np.zeros(SAMPLES // 20)
    faded = 0.1 * wave * signal.windows.tukey(SAMPLES, 0.05)
    return [("sweep", np.concatenate([rest, faded, rest]), scanner.rate)]


def noise(scanner: DrawnScanner, rng: np.random.Generator) -> list[Drive]:
    """Random drive, low-passed above three times the resonance."""
    corner = min(3.0 * scanner.resonance, 0.4 * scanner.rate)
    sections = signal.butter(4, corner, fs=scanner.rate, output="sos")
    wave = signal.sosfilt(sections, rng.standard_normal(SAMPLES))
    return [("noise", 0.3 * wave / np.abs(wave).max(), scanner.rate)]


def scans(scanner: DrawnScanner, rng: np.random.Generator) -> list[Drive]:
    """Triangles at two rates and two amplitudes."""
    del rng
    rate = _slow(scanner) * 4000.0
    return [
        (f"scan {size:g}, {speed:g}", size * _triangle(rate, speed * _slow(scanner), 4), rate)
        for size in (0.9, 0.4)
        for speed in (0.5, 1.0)
    ]


def steps(scanner: DrawnScanner, rng: np.random.Generator) -> list[Drive]:
    """Steps up and back, held for a minute each, at 100 samples a second."""
    del scanner, rng
    return [("steps", np.repeat([0.0, 0.2, 0.4, 0.1], [500, 6000, 6000, 6000]), 100.0)]


def reversal_curves(scanner: DrawnScanner, rng: np.random.Generator) -> list[Drive]:
    """First-order reversal curves from the upper limit, twenty of them."""
    del rng
    turns = np.linspace(-1.0, 0.9, 20)
    path = np.concatenate([[0.0, 1.0], np.column_stack([turns, np.ones(20)]).ravel(), [0.0]])
    rate = _slow(scanner) * 4000.0
    lengths = np.maximum(np.rint(np.abs(np.diff(path)) * 0.25 * rate / _slow(scanner)), 2.0)
    return [("curves", _path(path, lengths), rate)]


def decaying(scanner: DrawnScanner, rng: np.random.Generator) -> list[Drive]:
    """A sine whose amplitude decays from the limit over thirty cycles."""
    del rng
    rate = _slow(scanner) * 2000.0
    seconds = np.arange(round(30 * rate / _slow(scanner))) / rate
    envelope = 1.0 - seconds / seconds[-1]
    return [("decaying", envelope * np.sin(2.0 * np.pi * _slow(scanner) * seconds), rate)]


def _path(levels: Array, lengths: Array) -> Array:
    corners = np.concatenate([[0.0], np.cumsum(lengths)])
    return np.interp(np.arange(int(corners[-1]) + 1), corners, levels)


PROTOCOLS: dict[str, Sequence[Callable[[DrawnScanner, np.random.Generator], list[Drive]]]] = {
    "multisine alone": (multisine,),
    "sweep alone": (sweep,),
    "noise and loops": (noise, decaying),
    "scans alone": (scans,),
    "steps alone": (steps,),
    "curves and sweep": (reversal_curves, sweep),
    "steps, multisine, curves": (steps, multisine, reversal_curves),
    "steps, sweep, scans": (steps, sweep, scans),
}


FAST = {multisine, sweep, noise}
"""Drives that show the resonance."""


def taken(protocol: str, scanner: DrawnScanner, rng: np.random.Generator) -> list[afm.Record]:
    """Take the records of a protocol, each from depolarised rest."""
    return [
        record
        for maker in PROTOCOLS[protocol]
        for record in (taken_with(scanner, drive, rng) for drive in maker(scanner, rng))
    ]


def taken_with(scanner: DrawnScanner, drive: Drive, rng: np.random.Generator) -> afm.Record:
    """Drive a scanner; a second axis goes the other way round in time, so both differ."""
    name, shape, rate = drive
    shapes = [shape, -shape][: len(scanner.axes)]
    volts = np.column_stack([raised(scanner.swing * each, scanner.middle) for each in shapes])
    moved = scanner.measured(volts, 1.0 / rate, rng)
    axes = ("x", "y")[: len(scanner.axes)]
    return afm.Record(volts, moved, 1.0 / rate, axes=axes, start="depolarised", name=name)


def raised(shape: Array, middle: float) -> Array:
    """Move about the middle of a unipolar drive, reached and left by slow ramps."""
    if middle == 0.0:
        return shape
    samples, about = max(len(shape) // 20, 2), middle + shape
    up, down = np.linspace(0.0, about[0], samples), np.linspace(about[-1], 0.0, samples)
    return np.concatenate([up, about, down])
