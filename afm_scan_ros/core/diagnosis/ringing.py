"""How a floor moves with a resonance that an effect has moved.

What a model errs by at the drive rings through the stage, and is loudest where that resonates. A
mass that has come to ride on it takes the resonance, and so this error, into another band.
"""

from itertools import pairwise

import numpy as np

from afm_scan_ros.core.diagnosis.floor import VIBRATING, Floor
from afm_scan_ros.core.effects.vibration import VibrationModel
from afm_scan_ros.core.types import Array

POINTS = 200
"""Frequencies in a band: a resonance is a few Hz wide."""


def rung(floor: Floor, stage: VibrationModel, now: VibrationModel) -> Array:
    """Floor (bands,) in m, of a model of ``stage``, where that has come to vibrate as ``now``.

    It rises as the gain does, from the band on in which stages vibrate, and to no more than the
    loudest of these bands has without the effect.
    """
    if now == stage:
        return floor.rms
    edges = np.array(floor.edges)
    louder = np.clip(_gains(now, edges) / _gains(stage, edges), 1.0, None)
    vibrating = edges[:-1] >= VIBRATING
    loudest = floor.rms[vibrating].max(initial=0.0)
    moved = np.clip(louder * floor.rms, floor.rms, np.maximum(floor.rms, loudest))
    return np.where(vibrating, moved, floor.rms)


def _gains(stage: VibrationModel, edges: Array) -> Array:
    """Rms gain in each band (bands,), relative to that at rest."""
    omega = 2.0 * np.pi * np.array([np.linspace(*band, POINTS) for band in pairwise(edges)])
    power = np.mean(np.abs(stage.response(omega)) ** 2, axis=1)
    return np.asarray(np.sqrt(power) / stage.static_gain)
