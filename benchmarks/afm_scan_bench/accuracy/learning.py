"""What a drive can reach that learns from the true displacement, which no scanner shows.

Law: u ← u + g L (x_d - x), from scan to scan of the same path: iterative learning control, D. A.
Bristow, M. Tharayil and A. G. Alleyne, IEEE Control Systems 26 (2006) 96. L is the optimal inverse
with the default weight, of the scanner's own linear response: every mode of it is known exactly.
So it unlearns what hysteresis and the model's modes leave, and keeps what takes a bandwidth beyond
that weight, or a drive beyond the amplifier. A play is no linear response: what it learns of one
need not be the least.
"""

from contextlib import suppress

import numpy as np
from attrs import evolve

from afm_scan_bench.scans import SEED
from afm_scan_ros.core.comparison import rms_of
from afm_scan_ros.core.effects.optimal_inverse import OptimalInverse, SmoothWeight, sampled_kernel
from afm_scan_ros.core.errors import ScanError
from afm_scan_ros.core.metrics import Scan
from afm_scan_ros.core.types import Array, Trace
from afm_scan_ros.simulation.mechanisms.attachment import Attachment, YieldingAttachment
from afm_scan_ros.simulation.mechanisms.base import Mechanism
from afm_scan_ros.simulation.scanner import Piezoscanner, PlantSpec, SimulatedChain

AXIS = "x"
ROUNDS = 25
GAIN = 0.5
"""g, over the gain of the hysteresis at rest."""
WEIGHT = SmoothWeight(corner=5000.0, order=2)
LENGTH = 2**16
"""Samples of the response; the sharpest mode has died out."""


def learned(done: Scan, plant: PlantSpec) -> Scan:
    """Return the best of the scans that learning makes of one, along x."""
    inverse, gain = _learning(plant, done.spec.sample_period), GAIN / plant.x.hysteresis.gain
    best, last = done, done
    with suppress(ScanError):  # the amplifier gives no more
        for _ in range(ROUNDS):
            step = inverse.invert_whole(last.desired.x - last.true.x)
            drive = evolve(last.drive, x=last.drive.x + gain * step)
            measured, true = Piezoscanner(plant, done.spec.sample_period, SEED).advance(drive)
            last = evolve(last, drive=drive, measured=measured, true=true)
            best = min(best, last, key=error)
    return best


def error(done: Scan) -> float:
    """True rms error of x, m."""
    return rms_of(done.tracking("true"), AXIS)


def _learning(plant: PlantSpec, period: float) -> OptimalInverse:
    """L, which knows every target ahead."""
    answer = np.fft.rfft(_impulse_response(plant, period))
    kernel = sampled_kernel(lambda _: answer, WEIGHT, period, LENGTH)
    return OptimalInverse(kernel, kernel.centre)


def _is_linear(mechanism: Mechanism) -> bool:
    return isinstance(mechanism, Attachment) and not isinstance(mechanism, YieldingAttachment)


def _impulse_response(plant: PlantSpec, period: float) -> Array:
    """Displacement (m/V) at the instants after an impulse of F, of structure and attachments.

    Attachments that yield are left out.
    """
    block = evolve(
        plant.x.hysteresis, density=0.0, gain=1.0, input_quadratic=0.0, output_quadratic=0.0
    )
    attached = tuple(m for m in plant.mechanisms if _is_linear(m))
    linear = evolve(plant, x=evolve(plant.x, hysteresis=block), mechanisms=attached)
    chain, drive = SimulatedChain(linear, period), np.zeros(LENGTH)
    drive[0] = 1.0
    start = chain.at_rest(np.random.default_rng(0))
    return chain.advance(start, Trace(0, period, drive, np.zeros(LENGTH)))[1].x
