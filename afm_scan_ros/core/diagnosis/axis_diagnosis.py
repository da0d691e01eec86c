"""Diagnosis of one axis: its residual, the selected effects, and the verdict."""

from collections.abc import Sequence

import numpy as np
from attrs import frozen

from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.diagnosis.candidates import CandidateFitter, FittedCandidates, refit_on_all
from afm_scan_ros.core.diagnosis.evidence import Evidence
from afm_scan_ros.core.diagnosis.preparation import LEAST_MOTION, evidence_of
from afm_scan_ros.core.diagnosis.records import Observation
from afm_scan_ros.core.diagnosis.scoring import lack_of_fit
from afm_scan_ros.core.diagnosis.search import ModelSearch, ProgressCallback, Selection
from afm_scan_ros.core.diagnosis.time_invariance import synchronous_places, time_varying
from afm_scan_ros.core.effects.residual_features import ResidualFeatures, prominent_lines
from afm_scan_ros.core.model import ScannerModel
from afm_scan_ros.core.scanner import chain_of
from afm_scan_ros.core.types import Array

SUFFICIENT, FOUND, AMBIGUOUS = "model_sufficient", "effect_found", "ambiguous"
INSUFFICIENT, UNEXPLAINED = "insufficient_excitation", "unexplained"


@frozen(eq=False)
class AxisDiagnosis:
    """Result for one axis. ``chain`` is the model's, ``extended`` has the selected effects too.

    ``refit_on_all`` holds the selected effects with the values that are added to the model.
    ``time_varying`` are the places in it of effects whose amount changes over the records.
    ``ratio_before`` and ``ratio_after`` are the residual's rms over the detection limit by band,
    one array per record.
    """

    axis: str
    evidence: tuple[Evidence, ...]
    chain: Chain
    extended: Chain
    selection: Selection
    refit_on_all: FittedCandidates | None
    time_varying: tuple[int, ...]
    ratio_before: tuple[Array, ...]
    ratio_after: tuple[Array, ...]

    @property
    def verdict(self) -> str:
        """The verdict, one of the names in ``diagnosis.json``."""
        selection = self.selection
        if lack_of_fit(self.ratio_before, self.ratio_after) or self.time_varying:
            return UNEXPLAINED
        if selection.selected:
            doubtful = selection.competing_models or self.synchronous_places or self.untested
            return AMBIGUOUS if doubtful else FOUND
        return INSUFFICIENT if self._still else SUFFICIENT

    @property
    def synchronous_places(self) -> tuple[int, ...]:
        """Places of the disturbances that may be the model's own error, which repeats too."""
        selected = self.selection.selected
        return tuple(synchronous_places(selected, self.evidence)) if selected else ()

    @property
    def untested(self) -> bool:
        """Whether the model's error is not known for the motion of a record."""
        return any(each.untested for each in self.evidence)

    @property
    def final(self) -> Chain:
        """Chain with the selected effects as fitted; the model's chain where unexplained."""
        return self.chain if self.verdict == UNEXPLAINED else self.extended

    def rms(self, chain: Chain) -> float:
        """Rms residual (m) of all records on the test stretches."""
        squares = [np.mean(e.residual(chain)[~e.fitted] ** 2) for e in self.evidence]
        return float(np.sqrt(np.mean(squares)))

    @property
    def limit(self) -> float:
        """Rms of the detection limit over all records, m."""
        return float(np.sqrt(np.mean([e.limit.total**2 for e in self.evidence])))

    @property
    def _still(self) -> bool:
        return all(
            np.ptp(e.playback.displacement(self.chain))
            < LEAST_MOTION * np.linalg.norm(e.limit.noise)
            for e in self.evidence
        )


def diagnose_axis(
    axis: str, model: ScannerModel, observations: Sequence[Observation], progress: ProgressCallback
) -> AxisDiagnosis:
    """Find the effects that the model of one axis lacks, from the residuals of the records.

    Raises InputError where the model states no model discrepancy.
    """
    chain = chain_of(model.axis(axis))
    evidence = tuple(evidence_of(axis, model, each, i) for i, each in enumerate(observations))
    return diagnose_evidence(axis, chain, evidence, progress)


def diagnose_evidence(
    axis: str, chain: Chain, evidence: tuple[Evidence, ...], progress: ProgressCallback
) -> AxisDiagnosis:
    """Find the effects that a chain lacks, from the evidence of one axis."""
    bench = CandidateFitter(evidence, chain)
    selection = ModelSearch(
        bench, lambda c: _features(bench.decimated_evidence, c), progress
    ).select()
    selected = selection.selected
    extended = selected.extended(chain) if selected else chain
    return AxisDiagnosis(
        axis=axis,
        evidence=evidence,
        chain=chain,
        extended=extended,
        selection=selection,
        refit_on_all=refit_on_all(evidence, chain, selected) if selected else None,
        time_varying=tuple(time_varying(evidence, chain, selected)) if selected else (),
        ratio_before=tuple(e.ratio(chain) for e in evidence),
        ratio_after=tuple(e.ratio(extended) for e in evidence),
    )


def _features(evidence: Sequence[Evidence], chain: Chain) -> ResidualFeatures:
    """Features of the record whose residual exceeds its detection limit most."""
    loudest = max(evidence, key=lambda e: float(np.mean(e.normalised_residual(chain) ** 2)))
    view, residual = loudest.playback.view, loudest.residual(chain)
    period = view.sample_period
    lines = prominent_lines(residual, period)
    return ResidualFeatures(period, view.drive, view.measured, residual, view.other, lines)
