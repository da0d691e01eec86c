"""Terms of a suggested equation: quantities of a record, their products, and waves.

The design matrix holds the residual and the terms of all records in units of the detection limit.
"""

from collections.abc import Iterator, Sequence
from itertools import combinations_with_replacement
from typing import TypeVar

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

from afm_scan_ros.core.bands import weighted
from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.diagnosis.evidence import Evidence
from afm_scan_ros.core.diagnosis.playback import Playback
from afm_scan_ros.core.types import Array

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
