"""The micromanipulator's hysteresis identified anew beside whatever effect is tried.

All of the record is at 1 Hz, so a hysteresis fitted without an effect has taken up what it could
of it. An effect is therefore judged by what it leaves with the best density beside it: for every
trial the weights of the Preisach plane's cells are solved anew, in which the chain is linear.
"""

from collections.abc import Sequence
from functools import reduce
from operator import add

import numpy as np
from attrs import evolve, frozen
from numpy.typing import NDArray

from afm_scan_bench.measured.micromanipulator.film_shares import even, shares_behind_film
from afm_scan_bench.measured.micromanipulator.recent import Recent
from afm_scan_ros.core.cascade import Cascade
from afm_scan_ros.core.chain import RATE_INDEPENDENT, Chain
from afm_scan_ros.core.effects.creep import Creep
from afm_scan_ros.core.effects.vibration import Vibration
from afm_scan_ros.core.effects.viscous_plays import ViscousPlays
from afm_scan_ros.core.identification.joint.cells import (
    CellGrid,
    cell_count,
    surface_of,
    swept_areas,
)
from afm_scan_ros.core.identification.joint.density import NormalEquations, solve
from afm_scan_ros.core.model import HysteresisModel
from afm_scan_ros.core.types import Array

SMOOTHING = 1e-5
"""That which lets the stretches predict each other best, with lag and creep; see bench
manipulator."""
ROOM = 50_000_000
"""Bytes of columns of a record that are kept for the chains that have them too."""


@frozen(eq=False)
class FitRecord:
    """Drive (V), displacement (m) and which samples are ``fitted``, (n,), from saturation on."""

    drive: Array
    displacement: Array
    fitted: NDArray[np.bool_]
    sample_period: float


class _Columns:
    """Displacement (m per V of F) of each cell at the fitted samples of a record."""

    def __init__(self, fitted: FitRecord, span: CellGrid, every: int) -> None:
        self.fitted, self._span = fitted, span
        self.rows = np.flatnonzero(fitted.fitted)[::every]
        self._areas, self._moved = Recent(ROOM), Recent(ROOM)

    def of(self, chain: Chain) -> Array:
        """Columns (rows, cells) behind vibration and creep, of gain 1 at high frequency."""
        vibration, creep, period = (
            chain.model.vibration,
            chain.model.creep,
            self.fitted.sample_period,
        )
        before = Cascade(tuple(element.at(period) for element in chain.drive))
        drive = before.apply(before.at_rest(), self.fitted.drive)[1]
        swept = drive.tobytes(), self._answer(chain, drive).tobytes()

        def moved() -> Array:
            areas = self._areas.of(swept, lambda: self._shares(chain, drive))
            after = Cascade((Vibration(vibration, period), Creep(creep, period)))
            columns = [after.apply(after.at_rest(), area)[1][self.rows] for area in areas.T]
            return np.column_stack(columns) / vibration.static_gain

        return self._moved.of((*swept, vibration, creep), moved)

    def _shares(self, chain: Chain, drive: Array) -> Array:
        """What each cell's weight gives of F (n, cells); by differences where nothing is known."""
        span = self._span
        if chain.hysteresis == RATE_INDEPENDENT:
            return swept_areas(drive, span)
        element = chain.hysteresis_of(even(span)).at(self.fitted.sample_period)
        if isinstance(element, ViscousPlays):
            return shares_behind_film(element, drive, span)
        bare, ones = self._answer(chain, drive), np.eye(cell_count(span.cells))
        return np.column_stack([self._answer(chain, drive, one) - bare for one in ones])

    def _answer(self, chain: Chain, drive: Array, more: Array | float = 0.0) -> Array:
        """F (n,) of an even density and some ``more``, (cells,); nothing where it is Preisach's.

        What answers an even density alike is the same hysteresis, made once again.
        """
        if chain.hysteresis == RATE_INDEPENDENT:
            return np.empty(0)
        element = chain.hysteresis_of(even(self._span, more)).at(self.fitted.sample_period)
        return np.asarray(element.apply(element.at_rest(), drive)[1])


class Density:
    """Identifies a chain's hysteresis and gain from every n-th fitted sample.

    Reference gain: F runs from 0 at negative saturation over as many volts as the drive.
    """

    def __init__(self, fitted: Sequence[FitRecord], span: CellGrid, every: int = 1) -> None:
        self._span = span
        self._columns = [_Columns(each, span, every) for each in fitted]
        self._last: tuple[Chain, Chain] | None = None

    def anew(self, chain: Chain) -> Chain:
        """Chain with the hysteresis that suits its other elements best."""
        if self._last is None or self._last[0] is not chain:
            self._last = chain, self._identified(chain)
        return self._last[1]

    def _identified(self, chain: Chain) -> Chain:
        known = (self._equations(c, chain.of_record(i)) for i, c in enumerate(self._columns))
        weights = solve(reduce(add, known), SMOOTHING)
        lower, upper = self._span.lower, self._span.upper
        gain = 2.0 * float(weights.sum()) / (upper - lower)
        surface = surface_of(weights / gain, self._span, offset=0.0)
        elsewhere = tuple(
            _with(each, HysteresisModel(surface, surface), gain) for each in chain.elsewhere
        )
        return evolve(_with(chain, HysteresisModel(surface, surface), gain), elsewhere=elsewhere)

    def _equations(self, columns: _Columns, chain: Chain) -> NormalEquations:
        fitted = columns.fitted
        wanted = (fitted.displacement - _put_out(chain, fitted))[columns.rows]
        areas = columns.of(chain)
        return NormalEquations.of(areas - areas.mean(axis=0), wanted - wanted.mean(), len(wanted))


def _put_out(chain: Chain, fitted: FitRecord) -> Array:
    """What output elements add (m, (n,)) to the displacement under the density of before."""
    if not chain.output:
        return np.zeros_like(fitted.drive)
    stages = [stage.at(fitted.sample_period) for stage in chain.stages()]
    signal = fitted.drive
    for stage in stages[:-1]:
        signal = stage.apply(stage.at_rest(), signal)[1]
    return np.asarray(stages[-1].apply(stages[-1].at_rest(), signal)[1] - signal)


def _with(chain: Chain, hysteresis: HysteresisModel, gain: float) -> Chain:
    """Chain of another hysteresis and another G(0), m/V."""
    base = chain.model.vibration
    numerator = gain / base.static_gain * np.array(base.numerator)
    model = evolve(chain.model, hysteresis=hysteresis, vibration=evolve(base, numerator=numerator))
    return evolve(chain, model=model)
