"""One axis traced: its residual, the effects selected, and what may be said of them."""

from collections.abc import Sequence

import numpy as np
from attrs import frozen

from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.diagnosis.constancy import inconstant
from afm_scan_ros.core.diagnosis.evidence import Evidence
from afm_scan_ros.core.diagnosis.gathering import gathered
from afm_scan_ros.core.diagnosis.in_step import in_step
from afm_scan_ros.core.diagnosis.observation import Observation
from afm_scan_ros.core.diagnosis.remainder import too_much
from afm_scan_ros.core.diagnosis.selection import Selection, Selector, Told
from afm_scan_ros.core.diagnosis.settling import settled
from afm_scan_ros.core.diagnosis.trial import Bench, Trial
from afm_scan_ros.core.effects.residual_features import ResidualFeatures, prominent_lines
from afm_scan_ros.core.model import ScannerModel
from afm_scan_ros.core.scanner import chain_of
from afm_scan_ros.core.types import Array

SUFFICIENT, FOUND, AMBIGUOUS = "model_sufficient", "effect_found", "ambiguous"
INSUFFICIENT, UNEXPLAINED = "insufficient_excitation", "unexplained"

STILL = 100.0
"""Peak-to-peak motion over the sensor's noise, below which a record shows nothing of a model."""


@frozen(eq=False)
class AxisTrace:
    """What was found on one axis. ``chain`` is the model's, ``extended`` with what was kept.

    ``settled`` is what was kept, with the values that are stated and added to the model, and
    ``inconstant`` are the places in it of what is not there alike in all parts of the records.
    ``ratio_before`` and ``ratio_after`` are the residual's rms over the floor, band by band, one
    array a record.
    """

    axis: str
    evidence: tuple[Evidence, ...]
    chain: Chain
    extended: Chain
    selection: Selection
    settled: Trial | None
    inconstant: tuple[int, ...]
    ratio_before: tuple[Array, ...]
    ratio_after: tuple[Array, ...]

    @property
    def verdict(self) -> str:
        """What may be said, in the contract's words."""
        selection = self.selection
        if too_much(self.ratio_before, self.ratio_after) or self.inconstant:
            return UNEXPLAINED
        if selection.kept:
            return AMBIGUOUS if selection.rivals or self.in_step else FOUND
        return INSUFFICIENT if self._still else SUFFICIENT

    @property
    def in_step(self) -> tuple[int, ...]:
        """Places of the disturbances that may be what the model leaves of the motion itself."""
        kept = self.selection.kept
        return tuple(in_step(kept, self.evidence)) if kept else ()

    @property
    def final(self) -> Chain:
        """Chain with what was found, as selection fitted it; the bare one where unexplained."""
        return self.chain if self.verdict == UNEXPLAINED else self.extended

    def rms(self, chain: Chain) -> float:
        """Rms residual (m) of all records on what tests."""
        squares = [np.mean(e.residual(chain)[~e.teaches] ** 2) for e in self.evidence]
        return float(np.sqrt(np.mean(squares)))

    @property
    def floor(self) -> float:
        """Rms of the floor over all records, m."""
        return float(np.sqrt(np.mean([e.floor.total**2 for e in self.evidence])))

    @property
    def _still(self) -> bool:
        return all(
            np.ptp(e.playback.displacement(self.chain)) < STILL * np.linalg.norm(e.floor.noise)
            for e in self.evidence
        )


def trace_axis(
    axis: str, model: ScannerModel, observations: Sequence[Observation], told: Told
) -> AxisTrace:
    """Trace the residual of one axis of the records to effects that its model lacks.

    Raises InputError where the model states no known error.
    """
    chain = chain_of(model.axis(axis))
    evidence = tuple(gathered(axis, model, each, i) for i, each in enumerate(observations))
    return trace_evidence(axis, chain, evidence, told)


def trace_evidence(
    axis: str, chain: Chain, evidence: tuple[Evidence, ...], told: Told
) -> AxisTrace:
    """Trace what a chain leaves of the evidence gathered of one axis."""
    bench = Bench(evidence, chain)
    selection = Selector(bench, lambda c: _clues(bench.glances, c), told).select()
    kept = selection.kept
    extended = kept.extended(chain) if kept else chain
    return AxisTrace(
        axis=axis,
        evidence=evidence,
        chain=chain,
        extended=extended,
        selection=selection,
        settled=settled(evidence, chain, kept) if kept else None,
        inconstant=tuple(inconstant(evidence, chain, kept)) if kept else (),
        ratio_before=tuple(e.ratio(chain) for e in evidence),
        ratio_after=tuple(e.ratio(extended) for e in evidence),
    )


def _clues(evidence: Sequence[Evidence], chain: Chain) -> ResidualFeatures:
    """ResidualFeatures of the record whose residual exceeds its floor most."""
    loudest = max(evidence, key=lambda e: float(np.mean(e.excess(chain) ** 2)))
    view, residual = loudest.playback.view, loudest.residual(chain)
    period = view.sample_period
    lines = prominent_lines(residual, period)
    return ResidualFeatures(period, view.drive, view.measured, residual, view.other, lines)
