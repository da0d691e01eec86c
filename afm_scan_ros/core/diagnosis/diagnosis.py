"""Records and a model → what the model lacks, in the terms of ``diagnosis.json``."""

from collections.abc import Iterator, Sequence

from attrs import evolve, frozen

from afm_scan_ros.core.diagnosis.axis_diagnosis import (
    AMBIGUOUS,
    FOUND,
    INSUFFICIENT,
    SUFFICIENT,
    UNEXPLAINED,
    AxisDiagnosis,
    diagnose_axis,
)
from afm_scan_ros.core.diagnosis.cautions import Caution, cautions
from afm_scan_ros.core.diagnosis.discrepancy import VIBRATING
from afm_scan_ros.core.diagnosis.experiments import rank_experiments
from afm_scan_ros.core.diagnosis.records import Observation
from afm_scan_ros.core.diagnosis.result import Alternative, IdentifiedEffect, alternatives, effects
from afm_scan_ros.core.diagnosis.search import ProgressCallback
from afm_scan_ros.core.diagnosis.side_by_side import in_parallel
from afm_scan_ros.core.effects.registry import effect_type
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.model import Added, AxisModel, ScannerModel

GRAVITY = (SUFFICIENT, INSUFFICIENT, FOUND, AMBIGUOUS, UNEXPLAINED)
"""Verdicts of an axis; the scanner's is the gravest. One axis may be all that was recorded."""
BROADEST, VIBRATIONS = "amplitudes", "broadband"
"""Experiments proposed where nothing in the catalogue explains a residual; the second first where
it vibrates."""


@frozen(eq=False)
class ScannerDiagnosis:
    """What the records show of the scanner; see the contract's ``diagnosis.json``.

    ``noise_floor``, ``rms_before`` and ``rms_after`` (m) are of each axis, on stretches that the
    fit did not see. ``experiment`` names what ``afm-scan calibrate --experiment`` is to record.
    """

    observations: tuple[Observation, ...]
    by_axis: dict[str, AxisDiagnosis]
    model: ScannerModel
    verdict: str
    effects: tuple[IdentifiedEffect, ...]
    alternatives: tuple[Alternative, ...]
    experiment: str | None

    @property
    def noise_floor(self) -> dict[str, float]:
        """Rms of the floor of each axis over its records, m."""
        return {name: trace.floor for name, trace in self.by_axis.items()}

    @property
    def rms_before(self) -> dict[str, float]:
        """Rms residual of the model, m."""
        return {name: trace.rms(trace.chain) for name, trace in self.by_axis.items()}

    @property
    def rms_after(self) -> dict[str, float]:
        """Rms residual of the extended model, m."""
        return {name: trace.rms(trace.final) for name, trace in self.by_axis.items()}

    @property
    def cautions(self) -> tuple[Caution, ...]:
        """What limits the verdict."""
        return tuple(cautions(self.model, self.by_axis))


def diagnose(
    model: ScannerModel,
    observations: Sequence[Observation],
    progress: ProgressCallback = lambda _: None,
) -> ScannerDiagnosis:
    """Trace the residual of all records; ``progress`` hears what is being tried.

    Of each axis that the model and all records hold. Raises InputError where there is none, where
    the model states no model discrepancy, or where there is no record.
    """
    if not observations:
        raise InputError("no record is given: give one bag or more")
    by_axis = in_parallel(
        lambda name: diagnose_axis(name, model, observations, _on_axis(name, progress)),
        _axes_of_all(model, observations),
    )
    verdict = max((trace.verdict for trace in by_axis.values()), key=GRAVITY.index)
    return ScannerDiagnosis(
        observations=tuple(observations),
        by_axis=by_axis,
        model=extended_model(model, by_axis),
        verdict=verdict,
        effects=tuple(e for trace in by_axis.values() for e in effects(trace)),
        alternatives=tuple(a for trace in by_axis.values() for a in alternatives(trace)),
        experiment=_experiment(model, by_axis, observations),
    )


def extended_model(model: ScannerModel, by_axis: dict[str, AxisDiagnosis]) -> ScannerModel:
    """Model with every effect that was found, also where another could stand for it.

    Where an axis stays unexplained nothing is added to it.
    """
    return evolve(model, **{n: _extended(model.axis(n), trace) for n, trace in by_axis.items()})


def _axes_of_all(model: ScannerModel, observations: Sequence[Observation]) -> list[str]:
    """Axes that the model and all records hold; raises InputError where there is none."""
    axes = [name for name in model.axes if all(name in o.axes for o in observations)]
    if not axes:
        held = ", ".join(f"{o.name}: {' and '.join(o.axes)}" for o in observations)
        raise InputError(
            f"no axis is in the model ({' and '.join(model.axes)}) and in every record ({held}):"
            " give records of an axis that the model holds"
        )
    return axes


def _on_axis(axis: str, progress: ProgressCallback) -> ProgressCallback:
    return lambda candidate: progress(f"{axis}: trying {candidate}")


def _extended(axis: AxisModel, trace: AxisDiagnosis) -> AxisModel:
    refit_on_all = trace.refit_on_all
    if refit_on_all is None or trace.verdict == UNEXPLAINED:
        return axis
    added = (
        Added(c.effect.name, c.form.kind, tuple(refit_on_all.fit.values[refit_on_all.part(place)]))
        for place, c in enumerate(refit_on_all.candidates)
    )
    return evolve(axis, added=(*axis.added, *added))


def _experiment(
    model: ScannerModel, by_axis: dict[str, AxisDiagnosis], observations: Sequence[Observation]
) -> str | None:
    """Experiment for the gravest axis that needs one which is not among the records."""
    recorded = {observed.experiment for observed in observations}
    gravest = sorted(by_axis.values(), key=lambda t: GRAVITY.index(t.verdict), reverse=True)
    telling = (name for trace in gravest for name in _telling(model, trace))
    return next((name for name in telling if name not in recorded), None)


def _telling(model: ScannerModel, trace: AxisDiagnosis) -> Iterator[str]:
    """Yield the experiments that would tell more of an axis, the most telling first."""
    selected = trace.selection.selected
    if trace.verdict == AMBIGUOUS and selected:
        for place in trace.synchronous_places:
            yield effect_type(selected.names[place]).experiment
        for competing in trace.selection.competing_models:
            pair = effect_type(selected.names[competing.place]), competing.candidate.effect
            if pair[0] is pair[1]:
                forms = (trial.extended(trace.chain) for trial in (selected, competing.trial))
                yield from rank_experiments(trace.axis, model, *forms)
            # Any parameter may have shifted: it is the other effect that says where to look.
            for each in sorted(pair, key=lambda e: e.name == "parameter_shift"):
                yield each.experiment
    if trace.verdict == UNEXPLAINED and _loudest(trace) >= VIBRATING:
        yield VIBRATIONS
    if trace.verdict in (AMBIGUOUS, UNEXPLAINED, INSUFFICIENT):
        yield BROADEST


def _loudest(trace: AxisDiagnosis) -> float:
    """Lower edge (Hz) of the band that is left farthest above its floor."""
    left = zip(trace.evidence, trace.ratio_after, strict=True)
    loudest, ratio = max(left, key=lambda each: float(each[1].max()))
    return loudest.floor.edges[int(ratio.argmax())]
