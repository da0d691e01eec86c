"""Errors with an extended model, relative to the same scanner without the effect."""

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress

import numpy as np
from attrs import evolve, frozen

from afm_scan_bench.session import InProcessSession
from afm_scan_ros.core.closed_loop import FIRST, validation_specs
from afm_scan_ros.core.comparison import rms_of
from afm_scan_ros.core.effects.registry import effect_type
from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.metrics import Scan
from afm_scan_ros.core.model import Added, ScannerModel
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.scanner import predict
from afm_scan_ros.core.types import Array

UNSEEN = "rate"
"""Of the trials, the one whose residual is compared."""
PROBE = 1e-6
"""Value, in its unit, by which the influence of a parameter that acts linearly is seen."""


@frozen(eq=False)
class Repeated:
    """Scans of one axis with the extended inverse.

    ``residual`` is that of the extended model on a scan at an unseen rate. ``tracking`` is the true
    error of the diagnosed scan. Both are relative to the model on the healthy scanner. ``worst`` is
    the largest error after over that before, on the other scans. ``refused`` are the scans that the
    extended inverse cannot make; figures that need one are NaN.
    """

    residual_before: float
    residual: float
    tracking_before: float
    tracking: float
    worst: float
    refused: tuple[str, ...]


def repeated(
    axis: str,
    spec: ScanSpec,
    where: InProcessSession,
    twin: InProcessSession,
    models: Sequence[ScannerModel],
) -> Repeated:
    """Scan with the inverse of either of ``models``, the second of which is the extended one.

    ``twin`` is the healthy scanner.
    """
    comparisons = validation_specs(spec)
    model, extended = models
    after = _made(where, comparisons, extended)
    before = {name: where.scan(name, each, model) for name, each in comparisons.items()}
    healthy = {name: twin.scan(name, comparisons[name], model) for name in (FIRST, UNSEEN)}
    healthy_residual, best = left(axis, model, healthy[UNSEEN]), _error(axis, healthy[FIRST])
    others = [name for name in after if name != FIRST]
    return Repeated(
        residual_before=left(axis, model, before[UNSEEN]) / healthy_residual,
        residual=left(axis, extended, after[UNSEEN]) / healthy_residual
        if UNSEEN in after
        else math.nan,
        tracking_before=_error(axis, before[FIRST]) / best,
        tracking=_error(axis, after[FIRST]) / best if FIRST in after else math.nan,
        worst=max(
            (_error(axis, after[name]) / _error(axis, before[name]) for name in others),
            default=math.nan,
        ),
        refused=tuple(name for name in comparisons if name not in after),
    )


def _made(
    where: InProcessSession, comparisons: Mapping[str, ScanSpec], model: ScannerModel
) -> dict[str, Scan]:
    """Make those scans that the inverse of a model does not refuse."""
    made = {}
    for name, spec in comparisons.items():
        with suppress(InputError, ScanError):
            made[name] = where.scan(name, spec, model)
    return made


def left(axis: str, model: ScannerModel, done: Scan) -> float:
    """Rms residual (m) of one axis, with what is each record's own fitted to it.

    A disturbance's phase and a drift's rate are other ones in every scan.
    """
    common = _predicted(axis, evolve_own(axis, model, ()), done)
    shapes = [_predicted(axis, probed, done) - common for probed in _probed(axis, model)]
    basis = np.column_stack([*shapes, np.ones(len(common))])
    residual = done.measured.axis(axis) - common
    scaled = basis / np.linalg.norm(basis, axis=0)
    return float(np.std(residual - scaled @ np.linalg.lstsq(scaled, residual, rcond=None)[0]))


def evolve_own(axis: str, model: ScannerModel, probed: Sequence[tuple[int, int]]) -> ScannerModel:
    """Set each record's own parameters to 0, but for those of ``probed`` (effect, parameter)."""
    added = []
    for i, each in enumerate(model.axis(axis).added):
        values = [
            (PROBE if (i, k) in probed else 0.0) if own else value
            for k, (value, own) in enumerate(zip(each.values, _own(each), strict=True))
        ]
        added.append(evolve(each, values=values))
    return evolve(model, **{axis: evolve(model.axis(axis), added=tuple(added))})


def _probed(axis: str, model: ScannerModel) -> Iterator[ScannerModel]:
    for i, each in enumerate(model.axis(axis).added):
        for k, own in enumerate(_own(each)):
            if own:
                yield evolve_own(axis, model, [(i, k)])


def _own(added: Added) -> list[bool]:
    return [parameter.own for parameter in effect_type(added.name).form(added.kind).parameters]


def _predicted(axis: str, model: ScannerModel, done: Scan) -> Array:
    return predict(model, done.drive).axis(axis)


def _error(axis: str, done: Scan) -> float:
    return rms_of(done.tracking("true"), axis)
