"""Calibration records of the simulated scanner that take seconds, and their bags."""

from pathlib import Path

import numpy as np

from afm_scan_ros.bag.writer import ScanWriter
from afm_scan_ros.core.identification.drives.excitation import Plan
from afm_scan_ros.core.identification.drives.waveforms import multisine, waypoints
from afm_scan_ros.core.record import Record
from afm_scan_ros.core.scan_info import ScanInfo
from afm_scan_ros.core.types import Array


def creep() -> Plan:
    samples = 100.0 * np.array([0.0, 2.0, 2.1, 32.1, 32.2, 42.2, 44.0])
    steps = waypoints(np.array([0.0, 0.0, 0.5, 0.5, 1.0, 1.0, 0.0]), samples, 5.0)
    return Plan("creep", 0.01, steps, steps)


def frequency() -> Plan:
    """Lines every 10 Hz to 1 kHz, sampled at 10 kHz."""
    spectrum = np.zeros((3, 501), dtype=np.complex128)
    lines = np.arange(1, 101)
    phases = 2j * np.pi * np.random.default_rng(4).random((3, len(lines)))
    spectrum[:, lines] = np.minimum(1.0, 20.0 / lines) * np.exp(phases)
    waves = np.fft.irfft(spectrum, 1000)
    multisines = multisine(1.5 * waves / np.abs(waves).max(), repeats=6)
    return Plan("frequency", 1e-4, multisines, multisines)


def levels(seed: int) -> Array:
    """Sixty moves between random levels, 10 to 2000 V/s, sampled at 20 kHz."""
    rng = np.random.default_rng(seed)
    path = np.concatenate([[0.0, 0.0], 3.6 * rng.uniform(-1.0, 1.0, 60), [0.0, 0.0]])
    speeds = np.geomspace(10.0, 2000.0, 61)
    moves = np.abs(np.diff(path[1:-1])) / speeds + 1e-3
    seconds = np.concatenate([[0.1], moves, [0.1]])
    samples = np.concatenate([[0.0], np.cumsum(np.rint(2e4 * seconds))])
    return waypoints(path, samples, blend=20.0)


def bag(folder: Path, made: Record) -> Path:
    drive, displacement = made.traces()
    info = ScanInfo("s", 0, made.name, drive.sample_period, len(drive.x))
    with ScanWriter(folder / made.name, info) as writer:
        writer.add("drive_voltage", drive)
        writer.add("achieved_displacement", displacement)
    return folder / made.name
