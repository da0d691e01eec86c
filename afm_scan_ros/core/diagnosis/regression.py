"""Residual and terms of all records, side by side, in units of the floor."""

from collections.abc import Sequence
from typing import TypeVar

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

from afm_scan_ros.core.bands import weighted
from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.diagnosis.evidence import Evidence
from afm_scan_ros.core.diagnosis.library import Term
from afm_scan_ros.core.types import Array

Kind = TypeVar("Kind", bound=np.generic)

ROWS = 20_000
"""Samples taken of each record."""


@frozen(eq=False)
class Columns:
    """A term over all records: its signals as they are and in units of the floor, both (m, k)."""

    term: Term
    plain: Array
    white: Array


@frozen(eq=False)
class Sheet:
    """Residual (m,) of all records, in m and in units of the floor, and which samples teach."""

    evidence: tuple[Evidence, ...]
    plain: Array
    white: Array
    teaches: NDArray[np.bool_]

    @classmethod
    def of(cls, evidence: tuple[Evidence, ...], chain: Chain) -> "Sheet":
        """Lay out what a chain leaves of the records."""
        residuals = [each.residual(chain) for each in evidence]
        white = [_white(e, left) for e, left in zip(evidence, residuals, strict=True)]
        return cls(
            evidence,
            np.concatenate([_rows(left) for left in residuals]),
            np.concatenate(white),
            np.concatenate([_rows(each.teaches) for each in evidence]),
        )

    def columns(self, terms: Sequence[Term]) -> Columns:
        """Lay out one term, given for each record."""
        plain = [_rows(term.columns - term.columns.mean(axis=0)) for term in terms]
        white = [
            np.column_stack([_white(each, column) for column in term.columns.T])
            for each, term in zip(self.evidence, terms, strict=True)
        ]
        return Columns(terms[0], np.concatenate(plain), np.concatenate(white))

    def spread(self, values: Sequence[Array]) -> Array:
        """Rows (m,) of a signal of each record."""
        return np.concatenate([_rows(each) for each in values])


def _rows(signal: NDArray[Kind]) -> NDArray[Kind]:
    return signal[:: -(-len(signal) // ROWS)]


def _white(evidence: Evidence, signal: Array) -> Array:
    period = evidence.playback.view.sample_period
    return _rows(weighted(signal, evidence.floor.weights(len(signal), period)))
