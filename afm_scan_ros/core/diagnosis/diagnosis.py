"""Diagnosis of a scanner: from records and a model to verdict, effects and next experiment."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future
from threading import Thread
from typing import TypeVar

import numpy as np
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
from afm_scan_ros.core.diagnosis.cautions import (
    Caution,
    UnlikeHealthy,
    cautions,
    unlike_healthy,
    with_healthy,
)
from afm_scan_ros.core.diagnosis.experiments import (
    LONGEST,
    Proposal,
    SizedExperiment,
    hypotheses,
    propose,
)
from afm_scan_ros.core.diagnosis.result import (
    Alternative,
    IdentifiedEffect,
    alternatives,
    effects,
    joined,
)
from afm_scan_ros.core.diagnosis.structure import counted_exact, refitted
from afm_scan_ros.core.effects.registry import effect_type
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.drives.experiments import EXPERIMENTS
from afm_scan_ros.core.model import Added, AxisModel, ScannerModel
from afm_scan_ros.core.prediction import with_overshoot
from afm_scan_ros.core.record import Record
from afm_scan_ros.core.scanner import synchronised
from afm_scan_ros.core.types import ProgressCallback, Tally

SEVERITY = (SUFFICIENT, INSUFFICIENT, FOUND, AMBIGUOUS, UNEXPLAINED)
"""Verdicts in the order of severity; the scanner has the most severe of its axes."""
BROADEST, VIBRATIONS = "amplitudes", "broadband"
"""Experiments proposed for an unexplained residual; the second comes first where the residual lies
in the bands of vibration."""


@frozen(eq=False)
class ScannerDiagnosis:
    """Diagnosis of a scanner, with the fields of ``diagnosis.json``.

    ``noise_floor``, ``rms_before`` and ``rms_after`` (m) are of each axis, on stretches that the
    fit did not see. ``proposal`` is what ``afm-scan calibrate --experiment`` is to record.
    ``unlike`` are the healthy records that the model does not explain.
    """

    observations: tuple[Record, ...]
    by_axis: dict[str, AxisDiagnosis]
    model: ScannerModel
    verdict: str
    effects: tuple[IdentifiedEffect, ...]
    alternatives: tuple[Alternative, ...]
    proposal: Proposal | None
    unlike: tuple[UnlikeHealthy, ...] = ()

    @property
    def experiment(self) -> str | None:
        """Name of the proposed experiment."""
        return self.proposal.experiment.name if self.proposal else None

    @property
    def noise_floor(self) -> dict[str, float]:
        """Detection limit of each axis, rms over its records, m."""
        return {name: diagnosed.limit for name, diagnosed in self.by_axis.items()}

    @property
    def rms_before(self) -> dict[str, float]:
        """Rms residual of the model, m."""
        return {name: diagnosed.rms_before for name, diagnosed in self.by_axis.items()}

    @property
    def rms_after(self) -> dict[str, float]:
        """Rms residual of the extended model, m."""
        return {name: diagnosed.rms_after for name, diagnosed in self.by_axis.items()}

    @property
    def probabilities(self) -> dict[str, dict[str, float]]:
        """Posterior of each axis over sets of effects; names are joined by " + "."""
        return {
            axis: {
                joined(names): p for names, p in diagnosed.selection.posterior.probability.items()
            }
            for axis, diagnosed in self.by_axis.items()
        }

    @property
    def untested(self) -> bool:
        """Whether an axis with a residual moved as the model was never tested."""
        by_axis = self.by_axis.values()
        return any(one.untested and one.verdict in (AMBIGUOUS, UNEXPLAINED) for one in by_axis)

    @property
    def cautions(self) -> tuple[Caution, ...]:
        """Limitations of the verdict."""
        return (*self.unlike, *cautions(self.model, self.by_axis))


def diagnose(
    model: ScannerModel,
    observations: Sequence[Record],
    progress: ProgressCallback = lambda _: None,
    healthy: Sequence[Record] = (),
    longest: float = LONGEST,
    *,
    parallel: bool = True,
    structure: bool = False,
) -> ScannerDiagnosis:
    """Diagnose every axis that the model and all records have, in threads if ``parallel``.

    Records of the ``healthy`` scanner tell the model's error. ``progress`` is called with the axis
    and the effects that are being fitted, with their number on all axes. A proposed experiment
    lasts at most ``longest`` s.
    What the ``structure`` of the model lacks is traced where asked for: see structure.py.
    Raises InputError where no record or no common axis is given, or where the model states no model
    discrepancy.
    """
    if not observations:
        raise InputError("no record is given: give one bag or more")
    observations = [synchronised(model, each) for each in observations]
    healthy = [synchronised(model, each) for each in healthy]
    unlike = tuple(unlike_healthy(model, healthy))
    model = with_healthy(model, healthy)
    believed = counted_exact(model) if structure else model
    for observed in observations:
        believed = with_overshoot(believed, observed)
    tally = Tally(progress)
    by_axis = (in_parallel if parallel else _in_turn)(
        lambda name: diagnose_axis(
            name, believed, observations, tally.named(f"{name}: "), structure=structure
        ),
        _axes_of_all(model, observations),
    )
    progress("proposing what to record next")
    verdict = max((diagnosed.verdict for diagnosed in by_axis.values()), key=SEVERITY.index)
    return ScannerDiagnosis(
        observations=tuple(observations),
        by_axis=by_axis,
        model=extended_model(model, by_axis),
        verdict=verdict,
        effects=tuple(e for diagnosed in by_axis.values() for e in effects(diagnosed)),
        alternatives=tuple(a for diagnosed in by_axis.values() for a in alternatives(diagnosed)),
        proposal=next(_proposals(model, by_axis, observations, longest), None),
        unlike=unlike,
    )


def extended_model(model: ScannerModel, by_axis: dict[str, AxisDiagnosis]) -> ScannerModel:
    """Return the model with every effect found, also where other sets are credible.

    Nothing is added to an axis whose residual is unexplained.
    """
    return evolve(
        model, **{n: _extended(model.axis(n), diagnosed) for n, diagnosed in by_axis.items()}
    )


def _axes_of_all(model: ScannerModel, observations: Sequence[Record]) -> list[str]:
    """Axes that the model and all records hold; raises InputError where there is none."""
    axes = [name for name in model.axes if all(name in o.axes for o in observations)]
    if not axes:
        held = ", ".join(f"{o.name}: {' and '.join(o.axes)}" for o in observations)
        raise InputError(
            f"no axis is in the model ({' and '.join(model.axes)}) and in every record ({held}):"
            " give records of an axis that the model holds"
        )
    return axes


def _extended(axis: AxisModel, diagnosed: AxisDiagnosis) -> AxisModel:
    selected = diagnosed.selection.selected
    if selected is None or diagnosed.final is diagnosed.chain:
        return axis
    added = (
        Added(c.effect.name, c.form.kind, tuple(selected.fit.values[selected.part(place)]))
        for place, c in enumerate(selected.candidates)
    )
    values = np.array([value for _, value in diagnosed.selection.refitted])
    base = refitted(axis, values) if len(values) else axis
    return evolve(base, added=(*axis.added, *added))


def _proposals(
    model: ScannerModel,
    by_axis: dict[str, AxisDiagnosis],
    observations: Sequence[Record],
    longest: float,
) -> Iterator[Proposal]:
    """Yield experiments not recorded yet, for the axis of the most severe verdict first."""
    recorded = {observed.kind for observed in observations}
    names = [name for name in EXPERIMENTS if name not in recorded]
    by_severity = sorted(by_axis.values(), key=lambda t: SEVERITY.index(t.verdict), reverse=True)
    for diagnosed in by_severity:
        for name in _useful_experiments(diagnosed):
            if name in names:
                yield Proposal(diagnosed.axis, SizedExperiment.of_library(name, model))
            elif name is None and (
                found := propose(diagnosed.axis, model, hypotheses(diagnosed), names, longest)
            ):
                yield found


def _useful_experiments(diagnosed: AxisDiagnosis) -> Iterator[str | None]:
    """Yield experiments that would resolve the verdict of an axis, the best first.

    None stands for the one that tells most of the credible set.
    """
    selected = diagnosed.selection.selected
    if diagnosed.verdict == AMBIGUOUS and selected:
        for place in diagnosed.synchronous_places:
            yield effect_type(selected.names[place]).experiment
        yield None
    if diagnosed.verdict == UNEXPLAINED and _vibrates(diagnosed):
        yield VIBRATIONS
    if diagnosed.verdict in (AMBIGUOUS, UNEXPLAINED, INSUFFICIENT):
        yield BROADEST


def _vibrates(diagnosed: AxisDiagnosis) -> bool:
    """Whether the band that exceeds its detection limit most is one of vibration."""
    left = zip(diagnosed.evidence, diagnosed.ratio_after, strict=True)
    loudest, ratio = max(left, key=lambda each: float(each[1].max()))
    return bool(loudest.limit.vibrating[int(ratio.argmax())])


T = TypeVar("T")


def in_parallel(task: Callable[[str], T], names: Iterable[str]) -> dict[str, T]:
    """Run a task for each name in parallel; raise the first error among them.

    The threads are daemons, so an interrupted program does not wait for them.
    """
    results: dict[str, Future[T]] = {name: Future() for name in names}
    for name, result in results.items():
        Thread(target=_fulfil, args=(result, task, name), daemon=True).start()
    return {name: result.result() for name, result in results.items()}


def _in_turn(task: Callable[[str], T], names: Iterable[str]) -> dict[str, T]:
    return {name: task(name) for name in names}


def _fulfil(result: "Future[T]", task: Callable[[str], T], name: str) -> None:
    try:
        result.set_result(task(name))
    except BaseException as error:  # noqa: BLE001 - it is raised where the result is asked for
        result.set_exception(error)
