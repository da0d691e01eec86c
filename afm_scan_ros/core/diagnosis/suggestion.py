"""Suggests an equation for a residual that no effect explains.

The design matrix holds the residual and the terms of all records in units of the detection limit.

Forward orthogonal regression (Chen, Billings and Luo 1989). Each step adds the term that lowers the
misfit on the fitting stretches most; among terms nearly as good, the simplest. It ends where the
misfit on the test stretches no longer falls.
"""

from collections.abc import Iterator, Sequence
from itertools import combinations_with_replacement
from typing import TypeVar

import numpy as np
from attrs import frozen
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from afm_scan_ros.core.bands import weighted
from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.diagnosis.evidence import Evidence
from afm_scan_ros.core.diagnosis.records import Playback
from afm_scan_ros.core.types import AXES, Array

MICROMETRES_PER_METRE = 1e-6


@frozen(eq=False)
class Quantity:
    """A signal (n,) in ``unit``, such as µm; ``symbol`` stands for it in an equation."""

    symbol: str
    unit: str
    values: Array


@frozen(eq=False)
class Term:
    """A term of one or two coefficients: ``symbols``, ``units`` (k,) and signals (n, k).

    The simpler of two terms has the lower ``degree``.
    """

    symbols: tuple[str, ...]
    units: tuple[str, ...]
    degree: int
    columns: Array


def quantities(axis: str, playback: Playback, chain: Chain) -> dict[str, Quantity]:
    """Return the quantities of one axis of a record by symbol, observed ones before causes."""
    view = playback.view
    (other,) = {"x", "y"} - {axis}
    moved = playback.displacement(chain) / MICROMETRES_PER_METRE
    stage = chain.stages()[0].at(view.sample_period)
    found = (
        Quantity(axis, "µm", moved),
        Quantity(other, "µm", view.other / MICROMETRES_PER_METRE),
        Quantity(f"d{axis}/dt", "µm/s", np.asarray(np.gradient(moved, view.sample_period))),
        Quantity("t", "s", np.asarray(np.arange(len(moved)) * view.sample_period)),
        Quantity("u", "V", view.drive),
        Quantity("F", "V", playback.initial_state.played(stage, view.drive)),
    )
    return {quantity.symbol: quantity for quantity in found}


def products(of: dict[str, Quantity]) -> Iterator[Term]:
    """Yield the quantities, the products of two of them, and their cubes, in their order."""
    for each in of.values():
        yield _power(each, 1)
    for first, second in combinations_with_replacement(of.values(), 2):
        values = first.values * second.values
        same = first.unit == second.unit
        unit = f"{first.unit}²" if same else f"{first.unit} {second.unit}"
        product = Term((f"{first.symbol} {second.symbol}",), (unit,), 2, values[:, np.newaxis])
        yield _power(first, 2) if first is second else product
    for each in of.values():
        yield _power(each, 3)


def wave(of: Quantity, length: float) -> Term:
    """Sine and cosine of a quantity that repeat every ``length``, in its unit."""
    phase = 2.0 * np.pi * of.values / length
    argument = f"(2π {of.symbol} / {length:.4g} {of.unit})"
    columns = np.column_stack([np.sin(phase), np.cos(phase)])
    return Term((f"sin{argument}", f"cos{argument}"), ("", ""), 2, columns)


def _power(of: Quantity, degree: int) -> Term:
    symbol = f"({of.symbol})" if "/" in of.symbol and degree > 1 else of.symbol
    unit = f"({of.unit})" if "/" in of.unit and degree > 1 else of.unit
    raised = {1: "", 2: "²", 3: "³"}[degree]
    columns = (of.values**degree)[:, np.newaxis]
    return Term((symbol + raised,), (unit + raised,), degree, columns)


Kind = TypeVar("Kind", bound=np.generic)

MOST_ROWS = 20_000
"""Samples taken of each record."""


@frozen(eq=False)
class TermColumns:
    """A term over all records: its signals, plain and in detection limits, both (m, k)."""

    term: Term
    plain: Array
    white: Array


@frozen(eq=False)
class DesignMatrix:
    """Residual (m,) of all records, in m and in detection limits; ``fitted`` marks fitted ones."""

    evidence: tuple[Evidence, ...]
    plain: Array
    white: Array
    fitted: NDArray[np.bool_]

    @classmethod
    def of(cls, evidence: tuple[Evidence, ...], chain: Chain) -> "DesignMatrix":
        """Return the matrix for the residuals of a chain."""
        residuals = [each.residual(chain) for each in evidence]
        white = [_white(e, left) for e, left in zip(evidence, residuals, strict=True)]
        return cls(
            evidence,
            np.concatenate([_rows(left) for left in residuals]),
            np.concatenate(white),
            np.concatenate([_rows(each.fitted) for each in evidence]),
        )

    def columns(self, terms: Sequence[Term]) -> TermColumns:
        """Return the columns of one term, given for each record."""
        plain = [_rows(term.columns - term.columns.mean(axis=0)) for term in terms]
        white = [
            np.column_stack([_white(each, column) for column in term.columns.T])
            for each, term in zip(self.evidence, terms, strict=True)
        ]
        return TermColumns(terms[0], np.concatenate(plain), np.concatenate(white))

    def spread(self, values: Sequence[Array]) -> Array:
        """Rows (m,) of a signal of each record."""
        return np.concatenate([_rows(each) for each in values])


def _rows(signal: NDArray[Kind]) -> NDArray[Kind]:
    return signal[:: -(-len(signal) // MOST_ROWS)]


def _white(evidence: Evidence, signal: Array) -> Array:
    period = evidence.playback.view.sample_period
    return _rows(weighted(signal, evidence.limit.weights(len(signal), period)))


MOST = 3
"""Largest number of terms."""
PAYS = 0.1
"""Least share by which a term must lower the misfit on the test stretches."""
AS_WELL = 0.05
"""Share of the misfit within which a simpler term is as good as the best."""
LEAST_EXPLAINED = 0.3
"""Least share of the residual that a suggested equation explains."""
FINEST, STEP = 200.0, 0.25
"""Most periods of a wave over the range of a motion, and the step between those tried."""
NANOMETRES_PER_METRE = 1e-9


@frozen(eq=False)
class Suggestion:
    """An equation for the residual of one axis, and its share of unseen stretches' mean square.

    ``coefficients`` go with ``symbols``, each in nm per ``units``, those of the term.
    """

    axis: str
    symbols: tuple[str, ...]
    units: tuple[str, ...]
    coefficients: tuple[float, ...]
    explained: float

    @property
    def equation(self) -> str:
        """The equation as text."""
        given = zip(self.coefficients, self.symbols, self.units, strict=True)
        parts = [
            f"{'+' if value >= 0.0 else '-'} {abs(value):.3g} {_unit(unit)} {symbol}"
            for value, symbol, unit in given
        ]
        return f"residual {self.axis} ≈ {' '.join(parts).removeprefix('+ ')}"


def _unit(unit: str) -> str:
    if not unit:
        return "nm"
    return f"nm/({unit})" if " " in unit or "/" in unit else f"nm/{unit}"


def suggest(axis: str, evidence: tuple[Evidence, ...], chain: Chain) -> Suggestion | None:
    """Search an equation for the residual of one axis; None where none explains enough."""
    search = _Search(axis, evidence, chain)
    chosen: tuple[TermColumns, ...] = ()
    left = search.unseen(chosen)
    while len(chosen) < MOST:
        tried = (*chosen, search.next_after(chosen))
        reached = search.unseen(tried)
        if reached > (1.0 - PAYS) * left:
            break
        chosen, left = tried, reached
    found = search.suggestion(chosen)
    return found if found.explained > LEAST_EXPLAINED else None


class _Search:
    def __init__(self, axis: str, evidence: tuple[Evidence, ...], chain: Chain) -> None:
        self._axis = axis
        self._sheet = DesignMatrix.of(evidence, chain)
        self._known = [quantities(axis, each.playback, chain) for each in evidence]
        every = zip(*(products(known) for known in self._known), strict=True)
        self._products = [self._sheet.columns(terms) for terms in every]

    def unseen(self, chosen: tuple[TermColumns, ...]) -> float:
        """Mean square of the rest on the test stretches, in units of the detection limit."""
        left = self._left(chosen)[~self._sheet.fitted]
        return float(np.mean(left**2))

    def next_after(self, chosen: tuple[TermColumns, ...]) -> TermColumns:
        """Return the simplest of the best terms beside those chosen, the first one listed."""
        fitted, before = self._sheet.fitted, _joined(chosen, self._sheet)
        left = self._left(chosen)[fitted]
        offered = [*self._products, *self._waves(chosen)]
        gains = np.array([_gain(left, before[fitted], each.white[fitted]) for each in offered])
        good = np.flatnonzero(gains >= gains.max() - AS_WELL * float(left @ left))
        return offered[min(good, key=lambda i: offered[i].term.degree)]

    def suggestion(self, chosen: tuple[TermColumns, ...]) -> Suggestion:
        """Equation of the chosen terms, and the share it explains on unseen stretches."""
        weights = self._weights(chosen)
        plain = self._sheet.plain
        left = plain - np.hstack([c.plain for c in chosen]) @ weights if chosen else plain
        unseen = ~self._sheet.fitted
        symbols = tuple(symbol for each in chosen for symbol in each.term.symbols)
        units = tuple(unit for each in chosen for unit in each.term.units)
        explained = 1.0 - float(np.var(left[unseen]) / np.var(plain[unseen]))
        return Suggestion(
            self._axis, symbols, units, tuple(weights / NANOMETRES_PER_METRE), explained
        )

    def _weights(self, chosen: tuple[TermColumns, ...]) -> Array:
        fitted = self._sheet.fitted
        found = np.linalg.lstsq(
            _joined(chosen, self._sheet)[fitted], self._sheet.white[fitted], rcond=None
        )
        return np.asarray(found[0])

    def _left(self, chosen: tuple[TermColumns, ...]) -> Array:
        return self._sheet.white - _joined(chosen, self._sheet) @ self._weights(chosen)

    def _waves(self, chosen: tuple[TermColumns, ...]) -> Iterator[TermColumns]:
        """Yield for each axis the wave over its position that correlates best with the rest."""
        left = self._left(chosen)
        for symbol in AXES:
            place = self._sheet.spread([known[symbol].values for known in self._known])
            reach = float(np.ptp(place))
            if reach > 0.0:
                yield self._wave(symbol, place, left, reach)

    def _wave(self, symbol: str, place: Array, left: Array, reach: float) -> TermColumns:
        numbers = np.arange(2.0, FINEST, STEP) / reach
        power = [abs(np.exp(2j * np.pi * number * place) @ left) for number in numbers]
        coarse = float(numbers[int(np.argmax(power))])

        def made(number: float) -> TermColumns:
            terms = [wave(known[symbol], 1.0 / number) for known in self._known]
            return self._sheet.columns(terms)

        fitted, nothing = self._sheet.fitted, np.empty((int(self._sheet.fitted.sum()), 0))
        fine = minimize_scalar(
            lambda number: -_gain(left[fitted], nothing, made(number).white[fitted]),
            bounds=(coarse - STEP / reach, coarse + STEP / reach),
            method="bounded",
        )
        return made(float(fine.x))


def _joined(chosen: tuple[TermColumns, ...], sheet: DesignMatrix) -> Array:
    return np.hstack([np.empty((len(sheet.white), 0)), *(each.white for each in chosen)])


def _gain(left: Array, before: Array, columns: Array) -> float:
    """Reduction of the squared rest by columns (m, k) beside those before (m, j)."""
    basis, _ = np.linalg.qr(before)
    fresh = columns - basis @ (basis.T @ columns)
    return float(left @ fresh @ np.linalg.lstsq(fresh, left, rcond=None)[0])
