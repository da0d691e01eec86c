"""Models that state how well they know some of their effects."""

import numpy as np
from attrs import evolve

from afm_scan_ros.core.effects.parameter_shift import insert_creep, insert_resonance
from afm_scan_ros.core.model import AxisModel
from afm_scan_ros.core.scanner import chain_of
from afm_scan_ros.core.spread import Spread, Variant


def known(axis: AxisModel, width: float) -> AxisModel:
    """A model that knows creep's gains and the resonance within shares of their values.

    Their standard deviations are ``width`` and a hundredth of it, in a direction each.
    """
    chain = chain_of(axis)
    changed = (
        chain,
        insert_creep(chain, np.array([1.0 + width, 1.0])),
        insert_resonance(chain, np.array([1.0 + 0.01 * width, 1.0])),
    )
    centre, *directions = (
        Variant(m.hysteresis.forward, m.hysteresis.output, m.vibration, m.creep, m.sensor, d)
        for d, m in zip((0.0, 1.0, 1.0), (each.model for each in changed), strict=True)
    )
    return evolve(axis, spread=Spread(centre, tuple(directions), (0.0, 1.0), (0.0,)))
