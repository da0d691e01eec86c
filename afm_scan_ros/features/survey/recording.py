"""What a survey keeps of one recording, and the shifts of the model's parameters that it tells.

The shifts are of declared parameters, whether an effect is found or not.
The unknowns are the logarithms of the factors on gain, first resonance, its damping and the gains
of creep. Each prior is normal with the catalogue's bounds at two standard deviations. They are
fitted together by Gauss and Newton's method, under the likelihood of the diagnosis
(diagnosis/likelihood.py), as if no other effect were there.

With the weights w of the cells and the Gram matrices G of the influences, the covariance is
A = (I + sum w G)^-1. The sensor's noise of variance n in a cell of N coefficients adds
A (sum w^2 n G / N) A of it. The rest is that of the model's error.
"""

import math
from collections.abc import Callable, Iterator

import numpy as np
from attrs import frozen

from afm_scan_ros.core.bands import bounds, rms_by_band
from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.diagnosis.evidence import Evidence
from afm_scan_ros.core.diagnosis.likelihood import LinearResidual
from afm_scan_ros.core.effects.effect_type import EffectParameter
from afm_scan_ros.core.effects.parameter_shift import (
    CREEP,
    GAIN,
    RESONANCE,
    insert_creep,
    insert_gain,
    insert_resonance,
)
from afm_scan_ros.core.effects.vibration import first_resonance
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.model import CONFIDENT
from afm_scan_ros.core.types import Array

Interval = tuple[float, float]
ROUNDS = 10
PRECISION = 0.01
"""Change, in posterior standard deviations, that ends the fit."""
STEP = 0.01
"""Half the difference of an influence, in standard deviations of the prior."""
DETERMINED = 0.5
"""Posterior over prior standard deviation from which on a recording tells nothing of a value."""
RESIDUAL = "residual_ratio"
QUANTITIES = ("gain", "resonance", "damping", "creep", RESIDUAL)
"""Names of the estimates of an axis."""


@frozen
class QuantityEstimate:
    """A positive quantity of an axis, with the standard deviations of its logarithm.

    ``value`` is dimensionless: a factor on a parameter of the model, or a ratio. ``noise`` is the
    deviation by the sensor's noise alone, ``model_error`` that by the model's error, None where
    the value is no parameter.
    """

    name: str
    value: float
    noise: float
    model_error: float | None = None

    @property
    def interval(self) -> Interval:
        """95 % interval by noise and model error."""
        factor = math.exp(CONFIDENT * math.hypot(self.noise, self.model_error or 0.0))
        return self.value / factor, self.value * factor


@frozen
class EffectValue:
    """A parameter of an effect, in ``unit``; the 95 % interval is None where it is not known."""

    name: str
    unit: str
    value: float
    low: float | None = None
    high: float | None = None


@frozen
class NamedEffect:
    """An effect that a diagnosis named on an ``axis``, "x", "y" or "both"."""

    name: str
    kind: str
    axis: str
    probability: float
    values: tuple[EffectValue, ...]


@frozen
class SurveyedAxis:
    """Detection limit and residual of an axis, rms in m, and what its recording tells of it."""

    axis: str
    detection_limit: float
    residual: float
    estimates: tuple[QuantityEstimate, ...]


@frozen(kw_only=True)
class Recording:
    """One recording of an instrument, diagnosed, or the ``error`` why it could not be.

    ``recorded`` is the time of its first sample in ns since the epoch, 0 where it is not stated.
    Recordings of one ``motion`` follow the same path, so the model errs alike in them.
    ``model`` and ``version`` are the model's SHA-256 and the version of this package, ``identity``
    is a digest of the bag's files.
    """

    bag: str
    instrument: str
    identity: str
    model: str
    version: str
    recorded: int = 0
    scan_id: str = ""
    motion: str = ""
    samples: int = 0
    sample_rate: float = 0.0
    verdict: str = ""
    axes: tuple[SurveyedAxis, ...] = ()
    effects: tuple[NamedEffect, ...] = ()
    shortcomings: tuple[str, ...] = ()
    error: str = ""

    def estimates(self) -> Iterator[tuple[tuple[str, str], QuantityEstimate]]:
        """Yield each estimate with its axis and name."""
        for each in self.axes:
            for estimate in each.estimates:
                yield (each.axis, estimate.name), estimate


@frozen(eq=False)
class _Unknown:
    """A factor by its name, the prior deviation of its log, and what puts it into a chain."""

    name: str
    spread: float
    insert: Callable[[Chain, float], Chain]


def estimates(evidence: Evidence, chain: Chain) -> Iterator[QuantityEstimate]:
    """Yield the factors that a recording determines, and its residual over the detection limit.

    The last is the rms over the bands. Factors of what the model lacks are left out.
    """
    unknowns = tuple(_unknowns(chain))
    if unknowns:
        yield from _shifts(evidence, chain, unknowns)
    yield from _residual(evidence, chain)


def _unknowns(chain: Chain) -> Iterator[_Unknown]:
    yield _unknown("gain", GAIN[0], lambda c, v: insert_gain(c, np.array([v])))
    try:
        first_resonance(chain.model.vibration)
    except InputError:
        pass
    else:
        frequency, damping = RESONANCE
        yield _unknown("resonance", frequency, lambda c, v: insert_resonance(c, np.array([v, 1.0])))
        yield _unknown("damping", damping, lambda c, v: insert_resonance(c, np.array([1.0, v])))
    if np.any(chain.model.creep.gains):
        yield _unknown("creep", CREEP[0], lambda c, v: insert_creep(c, np.array([v, 1.0])))


def _unknown(
    name: str, parameter: EffectParameter, insert: Callable[[Chain, float], Chain]
) -> _Unknown:
    return _Unknown(name, 0.5 * float(np.log(parameter.upper)), insert)


def _shifts(
    evidence: Evidence, chain: Chain, unknowns: tuple[_Unknown, ...]
) -> Iterator[QuantityEstimate]:
    here, spreads = np.zeros(len(unknowns)), np.array([each.spread for each in unknowns])
    for _ in range(ROUNDS):
        there, covariance, by_noise = _step(evidence, chain, unknowns, here)
        moved = np.abs(there - here) / np.sqrt(np.diag(covariance))
        here = np.clip(there, -2.0, 2.0)
        if np.all(moved <= PRECISION):
            break
    for place, one in enumerate(unknowns):
        variance, noise = covariance[place, place], by_noise[place, place]
        if np.sqrt(variance) <= DETERMINED:
            error = np.sqrt(max(variance - noise, 0.0))
            value = float(np.exp(spreads[place] * here[place]))
            deviations = spreads[place] * np.sqrt(noise), spreads[place] * error
            yield QuantityEstimate(one.name, value, *map(float, deviations))


def _step(
    evidence: Evidence, chain: Chain, unknowns: tuple[_Unknown, ...], here: Array
) -> tuple[Array, Array, Array]:
    """Return the next values, their covariance and the noise's part of it, in prior deviations."""
    moved = [
        0.5
        / STEP
        * (
            _played(evidence, chain, unknowns, here + d)
            - _played(evidence, chain, unknowns, here - d)
        )
        for d in STEP * np.eye(len(here))
    ]
    view = evidence.playback.view
    left = view.measured - _played(evidence, chain, unknowns, here) + here @ np.array(moved)
    rows = evidence.cells.along(np.vstack((left, moved)))
    products = evidence.cells.products(rows, rows)
    linear = LinearResidual(products[:, 0, 0], products[:, 1:, 0], products[:, 1:, 1:])
    there = linear.profiled(evidence.variance.weights)
    weight = evidence.variance.weights(there.power)
    inner = np.eye(len(here)) + np.tensordot(weight, linear.gram, 1)
    covariance = np.asarray(np.linalg.inv(inner), dtype=np.float64)
    noise = weight**2 * evidence.variance.noise / evidence.cells.counts
    return (
        there.deviations,
        covariance,
        covariance @ np.tensordot(noise, linear.gram, 1) @ covariance,
    )


def _played(evidence: Evidence, chain: Chain, unknowns: tuple[_Unknown, ...], at: Array) -> Array:
    for unknown, deviations in zip(unknowns, at, strict=True):
        if deviations:
            chain = unknown.insert(chain, float(np.exp(unknown.spread * deviations)))
    return evidence.playback.displacement(chain)


def _counts(evidence: Evidence) -> Array:
    """Coefficients (bands,) in each band of a record."""
    view = evidence.playback.view
    found = np.diff(bounds(evidence.limit.edges, len(view.measured), view.sample_period))
    return np.asarray(np.maximum(found, 1), dtype=np.float64)


def _residual(evidence: Evidence, chain: Chain) -> Iterator[QuantityEstimate]:
    """Yield the rms over the bands of residual over detection limit, unless nothing is left.

    A band of mean square s2 and noise n has a variance of 2 n^2 / N + 4 n (s2 - n) / N by noise.
    """
    period = evidence.playback.view.sample_period
    power = rms_by_band(evidence.residual(chain), evidence.limit.edges, period) ** 2
    limit, noise = evidence.limit.rms**2, evidence.limit.noise**2
    variance = noise * (2.0 * noise + 4.0 * np.maximum(power - noise, 0.0)) / _counts(evidence)
    mean = float(np.mean(power / limit))
    deviation = float(np.sqrt(np.sum(variance / limit**2))) / len(limit)
    if mean > 0.0:
        yield QuantityEstimate(RESIDUAL, mean**0.5, 0.5 * deviation / mean)
