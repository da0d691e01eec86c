"""The model that a fit has found, and its few directions of uncertainty that move predictions most.

The model has the effects of an axis with their direct inverse. Predictions of a motion k with the
derivatives J_k vary by tr(C G_k) in all, with G_k = J_kᵀ J_k and the covariance C = L Lᵀ of θ. The
directions are L times the eigenvectors of

    Lᵀ [Σ_k G_k / tr(C G_k)] L.

Motions are the records, and scans from depolarised rest of several sizes, as fast and as slow as
the records are: what no record tells shows in these.
"""

from collections.abc import Iterator, Sequence

import numpy as np

from afm_scan_ros.core.effects.creep import CreepModel
from afm_scan_ros.core.effects.hysteresis.preisach import OutputMap
from afm_scan_ros.core.effects.vibration import VibrationModel
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.fit.candidates import rest_of
from afm_scan_ros.core.fit.estimator import AxisFit
from afm_scan_ros.core.fit.plays import Plays
from afm_scan_ros.core.fit.signals import Signals
from afm_scan_ros.core.fit.simulation import Simulation, jacobian, simulate
from afm_scan_ros.core.fit.surfaces import (
    direct_of,
    everett,
    everett_surface,
    from_rest,
    growing,
    nearest_surface,
    resting,
    surface_levels,
    surface_of,
)
from afm_scan_ros.core.model import AxisModel, HysteresisModel, HysteresisOperator
from afm_scan_ros.core.scanner import forward
from afm_scan_ros.core.spread import Variant
from afm_scan_ros.core.types import Array


def model_of(fit: AxisFit) -> AxisModel:
    """Return the model that a fit has found, with F = 0 at depolarised rest.

    Where plays found do not grow everywhere, they are mixed with a straight line so far that they
    have an inverse.
    """
    dynamics, sensor = fit.layout.dynamics(fit.theta), fit.layout.sensor_of(fit.theta)
    return AxisModel(_hysteresis(fit), _vibration(fit), dynamics.creep(), sensor=sensor)


def _vibration(fit: AxisFit) -> VibrationModel:
    """Return the vibration of a fit; where its lag is hidden, the gain alone.

    Lags that slow samples hardly show would make most of the error of a faster scan.
    """
    found = fit.layout.dynamics(fit.theta).vibration(fit.gain)
    if not fit.hidden_lag:
        return found
    pole = 1.0 / (fit.layout.settings.unseen_lag * fit.shortest)
    return VibrationModel((found.static_gain * pole,), (1.0, pole))


def _hysteresis(fit: AxisFit) -> HysteresisModel:
    layout, theta = fit.layout, fit.layout.of_operator(fit.theta)
    levels = layout.settings.direct_levels
    if isinstance(layout.operator, Plays):
        bias, _ = layout.operator.bias(rest_of(fit))
        surface = everett_surface(layout.operator, theta, bias, mixed=True)
        rest = layout.operator.output(theta, np.zeros(1), layout.operator.at_rest(rest_of(fit))[0])
        surface = resting(surface, float(rest[0]), layout.settings)
        surface, mapped = from_rest(surface, layout.map_of(fit.theta))
        return HysteresisModel(surface, direct_of(surface, mapped, levels), mapped)
    slopes = layout.operator.slopes(theta, rest_of(fit))
    nearest = nearest_surface(slopes, layout.settings)
    return HysteresisModel(slopes, direct_of(nearest, None, levels))


def variant_of(fit: AxisFit, move: Array, deviations: float) -> Variant:
    """Return the effects at θ + ``deviations`` ``move``, with F = 0 at depolarised rest.

    All variants of a fit have the same structure. Raises InputError where these are no effects.
    """
    layout, theta = fit.layout, fit.theta + deviations * move
    dynamics, sensor = layout.dynamics(theta), layout.sensor_of(theta)
    vibration, operator = dynamics.vibration(fit.gain), _coarse(fit, theta)
    creep = CreepModel(dynamics.gains, dynamics.time_constants)
    return Variant(*operator, vibration, creep, sensor, deviations)


def _coarse(fit: AxisFit, theta: Array) -> tuple[HysteresisOperator, OutputMap | None]:
    """Operator of ``spread_levels`` and the map behind it, as near θ as the model is to the fit."""
    layout, settings = fit.layout, fit.layout.settings
    plays, given = layout.operator, layout.of_operator(theta)
    rest = rest_of(AxisFit(layout, fit.records, fit.gain, theta))
    if not isinstance(plays, Plays):
        return plays.slopes(given, rest), None
    levels = surface_levels(plays, settings.spread_levels)
    fitted, _ = everett(plays, layout.of_operator(fit.theta), levels)
    values, offset = everett(plays, given, levels)
    values = values - fitted + growing(plays, fitted, levels)[0]
    surface = surface_of(plays, values, offset, plays.bias(rest)[0])
    return from_rest(surface, layout.map_of(theta))


def variants(
    fit: AxisFit, covariance: Array, every: Sequence[Array]
) -> tuple[Variant, tuple[Variant, ...]]:
    """Return the fit's own effects, and those in each direction of a covariance of θ.

    ``every`` are the normal equations' H of each record. A step in a direction is shorter than a
    standard deviation where the effects would have no inverse, or not be stable, at its end.
    """
    motions = [*every, *(_products(fit, *one) for one in scans(fit))]
    moves = principal(fit, covariance, motions)
    return variant_of(fit, np.zeros(fit.layout.size), 0.0), tuple(_along(fit, one) for one in moves)


def principal(fit: AxisFit, covariance: Array, motions: Sequence[Array]) -> Array:
    """Moves of θ by a standard deviation in each direction that counts, (directions, size).

    Each motion is given by its JᵀJ to any scale. The moves are longer by what others leave out.
    """
    settings = fit.layout.settings
    values, vectors = np.linalg.eigh(covariance)
    half = vectors * np.sqrt(np.maximum(values, 0.0))
    whole = np.zeros_like(covariance)
    for one in motions:
        seen = half.T @ one @ half
        if (variance := float(np.trace(seen))) > 0.0:
            whole += seen / variance
    values, vectors = np.linalg.eigh(whole)
    held = np.cumsum(values[::-1]) / max(float(np.sum(values)), np.finfo(float).tiny)
    count = int(np.searchsorted(held, 1.0 - settings.spread_left)) + 1
    count = min(count, settings.spread_directions, len(held))
    moves = (half @ vectors[:, ::-1][:, :count]).T
    return np.asarray(moves / np.sqrt(held[count - 1]))


def scans(fit: AxisFit) -> Iterator[tuple[Array, float]]:
    """Yield drives (V), (n,), from depolarised rest, and their sample periods (s)."""
    operator, settings = fit.layout.operator, fit.layout.settings
    middle, quarter = 0.5 * (operator.lower + operator.upper), settings.scan_samples // 4
    place = np.arange(9 * quarter + 1) / quarter
    wave = np.interp(place, np.arange(10.0), [0.0, *2 * [0.0, 1.0, 0.0, -1.0], 0.0])
    risen = np.minimum(place, 1.0)
    longest = max(len(one.drive) * one.period for one in fit.records)
    for period in (fit.shortest, longest / len(place)):
        for halved in range(settings.spread_sizes):
            drive = middle * risen + 0.5**halved * operator.half * wave
            yield np.clip(drive, operator.lower, operator.upper), period


def scan_from_rest(fit: AxisFit, drive: Array, period: float) -> Simulation:
    """Simulate a drive (V), (n,), of a sample period (s) from the depolarised rest of the model."""
    theta = fit.theta.copy()
    theta[fit.layout.parts["rest"]] = rest_of(fit)
    edges, still = np.arange(len(drive) + 1), np.zeros(len(drive))
    given = "a scan", drive, still, period, 1, 0
    record = Signals(*given, rested=True, noise=0.0, edges=edges)
    return simulate(fit.layout, theta, record)


def _products(fit: AxisFit, drive: Array, period: float) -> Array:
    """JᵀJ of a drive (V) from rest, or of its last cycle about the mean where no record rested."""
    simulation = scan_from_rest(fit, drive, period)
    operator, edges = fit.layout.operator, simulation.record.edges
    start, _ = fit.layout.at_rest(simulation.theta)
    pieces = operator.pieces(fit.layout.of_operator(fit.theta), drive, edges, start)
    rows = np.concatenate([one for _, one in jacobian(simulation, pieces)])
    if any(one.rested for one in fit.records):
        rows -= rows[0].copy()
    else:
        rows = rows[-fit.layout.settings.scan_samples :]
        rows -= rows.mean(axis=0)
    return np.asarray(rows.T @ rows)


def _along(fit: AxisFit, move: Array) -> Variant:
    """Return the effects a standard deviation along a move of θ, or as near to it as there are."""
    deviations = 1.0
    while deviations > np.finfo(np.float32).eps:
        try:
            return variant_of(fit, move, deviations)
        except InputError:
            deviations *= 0.5
    raise InputError("the fit's own effects have no inverse, or are not stable")


def lost_by(model: AxisModel, fit: AxisFit) -> float:
    """Mean squared share by which scans of a model and of its fit differ, but for their mean.

    The surface of the model has fewer levels than the plays have places, and where it does not grow
    it is another. The last cycle counts.
    """
    lost, cycle = [], slice(-fit.layout.settings.scan_samples, None)
    for drive, period in scans(fit):
        cascade, own = forward(model, period), fit.gain * scan_from_rest(fit, drive, period).output
        apart_by = cascade.apply(cascade.at_rest(), drive)[1] - own
        lost.append(np.var(apart_by[cycle]) / np.var(own[cycle]))
    return float(np.mean(lost))
