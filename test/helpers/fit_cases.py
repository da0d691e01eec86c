"""Scanners and records for the fit of all records, by code of their own.

The plays are of the model's own class; Duhem's and Bouc and Wen's operators are between maps, of
which the model knows neither.
"""

from collections.abc import Callable
from typing import TypeAlias

import numpy as np
from attrs import evolve
from scipy import signal

import afm_scan_ros as afm
from afm_scan_ros.core.fit.parameters import Layout, layout_of
from afm_scan_ros.core.fit.plays import Plays as PlayBank
from afm_scan_ros.core.fit.settings import FitSettings
from afm_scan_ros.core.fit.signals import (
    Signals,
    signals_of,
)
from afm_scan_ros.core.types import Array

PERIOD = 1e-4


LIMIT = 3.6


SETTINGS = FitSettings()


def bent(value: Array) -> Array:
    """A memoryless map, of some 4 % at the limits."""
    return value + 0.01 * value**2 - 0.001 * value**3


def of_plays(drive: Array) -> Array:
    """Forty plays and the drive itself, from their middle."""
    thresholds, play = np.linspace(0.05, 3.4, 40), np.zeros(40)
    output = np.empty_like(drive)
    for k, u in enumerate(drive):
        play = np.clip(play, u - thresholds, u + thresholds)
        output[k] = u + 0.012 * play.sum()
    return output


def of_duhem(drive: Array) -> Array:
    """Coleman and Hodgdon: dF = 0.7 |du| (u - F) + 0.7 du, along each sample exactly."""
    output, f, before = np.empty_like(drive), 0.0, 0.0
    for k, u in enumerate(drive):
        way = np.sign(u - before)
        lag = way * 0.3 / 0.7
        f = u - lag + (f - before + lag) * np.exp(-0.7 * abs(u - before))
        output[k], before = f, u
    return output


def of_bouc_wen(drive: Array) -> Array:
    """Low and Guo: F = u - h, dh = 0.35 du - 0.45 |du| h - 0.1 du |h|, in steps of 2 mV or less."""
    output, h, before = np.empty_like(drive), 0.0, 0.0
    for k, u in enumerate(drive):
        steps = int(abs(u - before) / 2e-3) + 1
        du = (u - before) / steps
        for _ in range(steps):
            middle = h + 0.5 * (0.35 * du - 0.45 * abs(du) * h - 0.1 * du * abs(h))
            h += 0.35 * du - 0.45 * abs(du) * middle - 0.1 * du * abs(middle)
        output[k], before = u - h, u
    return output


Operator: TypeAlias = Callable[[Array], Array]


OPERATORS: dict[str, Operator] = {
    "plays": of_plays,
    "duhem": of_duhem,
    "bouc_wen": of_bouc_wen,
}


def applied(operator: Operator, drive: Array) -> Array:
    """Output of an operator between two maps."""
    return bent(operator(bent(drive)))


GAIN, FREQUENCY, DAMPING = 1e-6, 230.0, 0.03


CREEP = 0.03, 0.4
"""Gain and time constant, s."""


def levels(seed: int, count: int, samples: int) -> Array:
    """Random levels joined by ever faster ramps, from 0 and back."""
    rng = np.random.default_rng(seed)
    reached = np.concatenate([[0.0], rng.uniform(-LIMIT, LIMIT, count), [0.0]])
    lengths = np.geomspace(samples, samples / 20.0, count + 1).round()
    ends = np.concatenate([[0.0], np.cumsum(lengths)])
    return np.asarray(np.interp(np.arange(ends[-1] + 1), ends, reached))


def displaced(operator: Operator, drive: Array, period: float = PERIOD) -> Array:
    """Displacement (m) of a scanner whose filters are SciPy's, without noise."""
    omega = 2.0 * np.pi * FREQUENCY
    system = [omega**2], [1.0, 2.0 * DAMPING * omega, omega**2]
    above, below, _ = signal.cont2discrete(system, period)
    early = signal.lfilter(above.ravel(), below, applied(operator, drive))
    kept = np.exp(-period / CREEP[1])
    late = signal.lfilter([0.0, 1.0 - kept], [1.0, -kept], early)
    return np.asarray(GAIN * (early + CREEP[0] * late))


def record(operator: Operator, drive: Array, tone: float = 0.0) -> afm.Record:
    rng = np.random.default_rng(7)
    seconds = PERIOD * np.arange(len(drive))
    hum = tone * np.sin(2.0 * np.pi * 50.02 * seconds + 1.0)
    moved = displaced(operator, drive) + hum + rng.normal(0.0, 0.2e-9, len(drive))
    return afm.Record(drive, moved, PERIOD, start="depolarised", name="levels")


def signals(drive: Array, moved: Array, block: int) -> Signals:
    given = afm.Record(drive, moved, PERIOD, start="depolarised", name="a")
    found = signals_of(given, drive, LIMIT, SETTINGS)
    return evolve(found, block=block, edges=block * np.arange(len(drive) // block + 1))


def of_plays_alone(drive: Array, moved: Array) -> tuple[Layout, list[Signals], float, Array]:
    layout = layout_of(PlayBank(-LIMIT, LIMIT), 1.0, PERIOD, SETTINGS)
    return layout, [signals(drive, moved, 1)], GAIN, layout.start()
