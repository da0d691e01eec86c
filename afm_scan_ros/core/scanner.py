"""The cascades of a model, with the effects added to it."""

from collections.abc import Iterable

import numpy as np

from afm_scan_ros.core.cascade import Cascade
from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.effects.registry import effect_type
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.model import AxisModel, InverseSettings


def chain_of(axis: AxisModel) -> Chain:
    """Return the chain of one axis.

    Raises InputError for an effect that the catalogue lacks, or that cannot stand beside those
    before it, named by its place.
    """
    chain = Chain(axis)
    for place, added in enumerate(axis.added):
        try:
            form = effect_type(added.name).form(added.kind)
            chain = form.insert(chain, np.array(added.values))
        except InputError as error:
            raise InputError(f"added[{place}]: {added.name}: {error}") from error
    return chain


def forward(axis: AxisModel, sample_period: float) -> Cascade:
    """Return the model of one axis, from drive (V) to its own displacement (m)."""
    return chain_of(axis).forward(sample_period)


def compensator(
    axis: AxisModel, sample_period: float, inverses: Iterable[str], settings: InverseSettings
) -> Cascade:
    """Return the cascade whose inverse compensates the effects named; see ``Chain``."""
    return chain_of(axis).compensator(sample_period, inverses, settings)
