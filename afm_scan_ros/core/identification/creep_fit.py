"""A creep record → the springs and dampers in series of Eq. 1 (Croft, Shed & Devasia 2001).

While the drive rests after a step, so does the hysteresis' output F: the step's height in F is
unknown, its shape is not. The record therefore shows creep alone, whatever the hysteresis is.
"""

import numpy as np
from attrs import frozen
from scipy.optimize import least_squares
from scipy.signal import lfilter

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.recording import Misfit, misfit
from afm_scan_ros.core.model import CreepModel
from afm_scan_ros.core.types import Array

SETTLING = 0.3
"""Seconds after a move that are left out: the vibration dies there."""


@frozen
class CreepFit:
    """The creep of one axis; misfits in m on the first hold (fitted) and the second (held out)."""

    model: CreepModel
    fitted: Misfit
    held_out: Misfit


@frozen(eq=False)
class _Hold:
    """A stretch of constant drive, of samples ``first`` to ``last``, and the step before it."""

    step: Array
    """Drive of the whole record due to this step, as a share of the step, shape (n,)."""
    first: int
    last: int


def fit_creep(drive: Array, displacement: Array, sample_period: float, order: int = 3) -> CreepFit:
    """Fit Eq. 1, as 1 + Σ g_i/(1 + s τ_i), to one axis: drive (V) and displacement (m), both (n,).

    The gains and time constants come from the first hold. On the second only the step's height is
    estimated. Raises InputError unless the drive holds still twice after a first rest.
    """
    rest, first, second = _holds(drive, sample_period)
    origin = displacement[rest.first : rest.last].mean()
    creeping = displacement - origin
    model, amplitude = _fit_hold(first, creeping[first.first : first.last], sample_period, order)
    response = amplitude * _respond(model, first.step, sample_period)
    left = (creeping - response)[second.first : second.last]
    shape = _respond(model, second.step, sample_period)[second.first : second.last]
    height = shape @ left / (shape @ shape)
    fitted = (creeping - response)[first.first : first.last]
    return CreepFit(model, misfit(fitted), misfit(left - height * shape))


def _holds(drive: Array, sample_period: float) -> list[_Hold]:
    moving = np.flatnonzero(np.diff(drive)) + 1
    edges = np.concatenate([[0], moving, [len(drive)]])
    settling = int(np.ceil(SETTLING / sample_period))
    starts = edges[:-1][np.diff(edges) > 2 * settling]
    ends = edges[1:][np.diff(edges) > 2 * settling]
    if len(starts) < 3:  # noqa: PLR2004 - the rest and two holds
        raise InputError(
            f"creep record: the drive holds still {len(starts)} times for longer than"
            f" {2 * SETTLING} s; rest, step, hold, step and hold are needed"
        )
    levels = np.concatenate([drive[starts[:1]], drive[starts[:3]]])
    return [
        _Hold(_share(drive, below, level, start), start + settling, end)
        for below, level, start, end in zip(levels, levels[1:], starts, ends, strict=False)
    ]


def _share(drive: Array, below: float, level: float, reached: int) -> Array:
    """Return the step from ``below`` to ``level`` as a share of itself, held for ever after."""
    if level == below:
        return np.zeros_like(drive)
    share = np.clip((drive - below) / (level - below), 0.0, 1.0)
    share[reached:] = 1.0
    return share


def _fit_hold(
    hold: _Hold, creeping: Array, sample_period: float, order: int
) -> tuple[CreepModel, float]:
    """Free time constants by least squares; for each choice the gains follow linearly."""
    span = (hold.last - hold.first) * sample_period
    guess = np.log(np.geomspace(span / 1000, span / 5, order))

    def basis(log_constants: Array) -> Array:
        lags = [_lag(hold.step, np.exp(tau), sample_period) for tau in log_constants]
        return np.column_stack([hold.step, *lags])[hold.first : hold.last]

    def residual(log_constants: Array) -> Array:
        columns = basis(log_constants)
        weights = np.linalg.lstsq(columns, creeping, rcond=None)[0]
        return np.asarray((creeping - columns @ weights) / np.ptp(creeping))

    found = least_squares(residual, guess, method="lm", xtol=1e-12, ftol=1e-12).x
    found.sort()
    weights = np.linalg.lstsq(basis(found), creeping, rcond=None)[0]
    gains = tuple(float(weight / weights[0]) for weight in weights[1:])
    model = CreepModel(gains=gains, time_constants=tuple(float(tau) for tau in np.exp(found)))
    return model, float(weights[0])


def _respond(model: CreepModel, step: Array, sample_period: float) -> Array:
    terms = zip(model.gains, model.time_constants, strict=True)
    return step + sum(gain * _lag(step, tau, sample_period) for gain, tau in terms)


def _lag(held: Array, time_constant: float, sample_period: float) -> Array:
    """1/(1 + s τ) of a signal held between samples, sampled just before each update."""
    kept = np.exp(-sample_period / time_constant)
    return np.asarray(lfilter([0.0, -np.expm1(-sample_period / time_constant)], [1.0, -kept], held))
