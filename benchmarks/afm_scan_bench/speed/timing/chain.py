"""How fast the whole chain of inverses and the simulated scanner are, as ratios."""

from collections.abc import Callable, Iterator

import numpy as np
from attrs import evolve
from scipy import fft, signal

from afm_scan_bench.scans import ALL, SEED, default_model, default_plant, spec_at
from afm_scan_bench.speed.timing.race import Task, race
from afm_scan_ros.core.compensation import Compensation, Progress
from afm_scan_ros.core.model import InverseSettings
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.trajectory import desired
from afm_scan_ros.core.types import AXES, Trace
from afm_scan_ros.report.table import Row
from afm_scan_ros.simulation.axis import Dynamics
from afm_scan_ros.simulation.scanner import Piezoscanner

BLOCK = 1000
LINES = 250_000
"""More than any record here is long."""


def long_scan() -> ScanSpec:
    """Return a scan of 100 lines a second, 50 kHz, with lines enough for any record here."""
    return evolve(spec_at(100.0), lines=LINES)


def chain_of_inverses() -> Compensation:
    """Return all inverses, as the default nodes have them."""
    limits = default_plant().amplifier.limits
    return Compensation(default_model(), long_scan().sample_period, ALL, InverseSettings(), limits)


def rows(samples: int, streamed: int, turns: int) -> Iterator[Row]:
    """Race the chain over ``samples``, and its stream and the scanner over ``streamed``."""
    scan, chain = desired(long_scan(), 0, samples), chain_of_inverses()
    yield race(
        "all three inverses, whole, 2 axes",
        Task(lambda: chain.whole(scan), samples),
        "a real FFT and its inverse of the same arrays",
        Task(lambda: [fft.irfft(fft.rfft(v), samples) for v in (scan.x, scan.y)], samples),
        "≤ 3",
        turns,
    )
    part = desired(long_scan(), 0, streamed)
    yield race(
        f"the stream of them, blocks of {BLOCK}",
        Task(lambda: stream(chain, chain.at_rest(), part, BLOCK), streamed),
        "the whole",
        Task(lambda: chain.whole(part), streamed),
        "≤ 2",
        turns,
    )
    drive = chain.whole(part)
    yield race(
        "the simulated scanner, 2 axes",
        Task(lambda: simulated(drive), streamed),
        f"lfilter with as many states ({', '.join(str(n) for n in states().values())})",
        Task(filtered(drive), streamed),
        "≤ 3",
        turns,
    )


def stream(chain: Compensation, progress: Progress, scan: Trace, size: int) -> Progress:
    """Invert a scan, or a stretch of one, in blocks, from a progress on."""
    for first in range(0, len(scan.x), size):
        x, y = (scan.axis(name)[first : first + size] for name in AXES)
        block = Trace(scan.first_sample + first, scan.sample_period, x, y)
        progress, _ = chain.invert(progress, block)
    return progress


def simulated(drive: Trace) -> None:
    """Drive the default plant."""
    Piezoscanner(default_plant(), drive.sample_period, SEED).advance(drive)


def states() -> dict[str, int]:
    """Real numbers that each axis of the default plant remembers: plays, and its sections'."""
    plant = default_plant()
    poles = {n: Dynamics.from_spec(a, 1.0).poles for n, a in plant.axes().items()}
    return {
        name: axis.hysteresis.elements + int(np.sum(np.where(poles[name].imag != 0.0, 2, 1)))
        for name, axis in plant.axes().items()
    }


def filtered(drive: Trace) -> Callable[[], object]:
    """Filter each axis by a stable filter with as many states as it has."""
    orders = states()
    poles = {n: 0.5 * np.exp(2j * np.pi * np.arange(1, k + 1) / (k + 1)) for n, k in orders.items()}
    denominators = {name: np.poly(p).real for name, p in poles.items()}
    numerators = {name: np.ones(k + 1) for name, k in orders.items()}
    return lambda: [signal.lfilter(numerators[n], denominators[n], drive.axis(n)) for n in AXES]
