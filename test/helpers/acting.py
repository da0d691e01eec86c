"""Mechanisms acting alone on a signal, and signals to act on."""

import numpy as np
from numpy.polynomial import Polynomial
from scipy import signal

from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.mechanisms.attachment import AttachedStage, Attachment
from afm_scan_ros.simulation.mechanisms.base import Insert

STEP = 5e-6
STAGE = AttachedStage(2.0 * np.pi * 454.0, 0.012)
STIFF_STAGE = AttachedStage(1e5, 0.7)  # follows a force at once
WAVE = 10e-6 * np.sin(np.arange(4000) * 2.0 * np.pi / 1000.0)
TIME = STEP * np.arange(WAVE.size)
S = Polynomial([0.0, 1.0])


def act(
    insert: Insert, own: Array, other: Array | None = None, seed: int = 0, step: float = STEP
) -> Array:
    """Signal of the axis after an insert, from rest on; the other axis rests unless given."""
    state = insert.at_rest(step, np.random.default_rng(seed))
    return insert.act(state, own, np.zeros_like(own) if other is None else other, step)[1]


def held(
    attachment: Attachment, x: Array, y: Array | None = None, stage: AttachedStage = STAGE
) -> Array:
    """Displacement of x (m) with what is attached to it, from rest on."""
    attached = attachment.attached(stage)
    rest = attached.at_rest(STEP, np.random.default_rng(0))
    both = np.vstack((x, np.zeros_like(x) if y is None else y))
    return attached.apply(rest, both, STEP)[1][0]


def answer(above: Polynomial, below: Polynomial) -> Array:
    """What a transfer function makes of the wave, which runs straight within a step."""
    return np.asarray(signal.lsim((above.coef[::-1], below.coef[::-1]), WAVE, TIME)[1])
