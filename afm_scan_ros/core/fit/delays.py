"""A delay of the measuring chain: whole samples of each record, and what is left of it."""

from collections.abc import Iterator

import numpy as np
from attrs import evolve

from afm_scan_ros.core.fit.estimator import AxisFit


def read_late(fit: AxisFit) -> AxisFit:
    """Return a fit whose drives are late by whole samples, the nearest ones to its delay.

    Derivatives do not see what is left of that, which may be half a sample more or less.
    """
    delay, layout, settings = fit.layout.delay_of(fit.theta), fit.layout, fit.layout.settings
    samples = [round(delay / one.period) for one in fit.records]
    if samples == [one.late for one in fit.records]:
        return fit
    pairs = list(zip(fit.records, samples, strict=True))
    records = [one.read_late(late, layout.operator.half, settings) for one, late in pairs]
    least = max(0.0, *((late - 1) * one.period for one, late in pairs))
    layout = evolve(layout, least_delay=least)
    return AxisFit(layout, records, fit.gain, fit.theta, fit.discrepancy, fit.scales)


def by_whole_samples(fit: AxisFit) -> Iterator[AxisFit]:
    """Yield the fit with its delay at the samples of the fastest record around it, as of buffers.

    At such a delay the response to steps of a drive has a corner, which hides it from descents.
    """
    period, delay = fit.shortest, fit.layout.delay_of(fit.theta)
    for samples in (np.floor(delay / period), np.ceil(delay / period)):
        theta = fit.theta.copy()
        theta[fit.layout.delay_place] = samples * period
        whole = AxisFit(fit.layout, list(fit.records), fit.gain, theta, fit.discrepancy, fit.scales)
        yield read_late(whole)
