"""Diagnosis of coupled axes: verdict, effects, and the structure identified anew with them."""

import math
from collections.abc import Iterator, Sequence

import numpy as np
from attrs import frozen

from afm_scan_ros.core.coupled_scanner import CoupledScanner, valued
from afm_scan_ros.core.diagnosis.axis_diagnosis import (
    AMBIGUOUS,
    FOUND,
    SUFFICIENT,
    UNEXPLAINED,
)
from afm_scan_ros.core.diagnosis.coupled.evidence import HeldOutLikelihood, diagnosed_records
from afm_scan_ros.core.diagnosis.coupled.search import CoupledSearch, SetPosterior
from afm_scan_ros.core.diagnosis.result import (
    RUNNERS_UP,
    Alternative,
    EffectEvidence,
    IdentifiedEffect,
    Value,
    WhyNot,
    joined,
)
from afm_scan_ros.core.diagnosis.search import OUTSIDE, Names
from afm_scan_ros.core.diagnosis.settings import SEARCH
from afm_scan_ros.core.effects.effect_type import EffectParameter
from afm_scan_ros.core.effects.registry import changes_linearly, coupled_form
from afm_scan_ros.core.identification.state_space.identify import CoupledSetting, identify_coupled
from afm_scan_ros.core.record import Record
from afm_scan_ros.core.types import Array, ProgressCallback

ALL = "all"
"""An effect acts on the structure, and so on all axes."""


@frozen(eq=False)
class CoupledDiagnosis:
    """Diagnosis of coupled axes, with the fields of ``diagnosis.json``.

    ``model`` is the scanner's with the effects that are stated. Lengths are in m, by axis, of the
    records that no fit saw.
    """

    base: CoupledScanner
    model: CoupledScanner
    likelihood: HeldOutLikelihood
    posterior: SetPosterior

    @property
    def verdict(self) -> str:
        """The verdict, one of the names in ``diagnosis.json``."""
        return verdict_of(self.posterior)

    @property
    def selected(self) -> Names:
        """Names of the effects that are stated."""
        return self.posterior.likeliest if self.verdict in (FOUND, AMBIGUOUS) else ()

    @property
    def probabilities(self) -> dict[str, dict[str, float]]:
        """Posterior over sets of effects; names are joined by " + "."""
        logs = self.posterior.logs
        return {ALL: {joined(names): float(np.exp(log)) for names, log in logs.items()}}

    @property
    def noise_floor(self) -> dict[str, float]:
        """Detection limit of each axis, m."""
        return self._by_axis(self.likelihood.limits())

    @property
    def rms_before(self) -> dict[str, float]:
        """Rms residual of the model, m."""
        return self._by_axis(self.likelihood.rms(self.likelihood.base))

    @property
    def rms_after(self) -> dict[str, float]:
        """Rms residual with the effects that are stated, m."""
        return self._by_axis(self.likelihood.rms(self._simulated(self.selected)))

    @property
    def effects(self) -> tuple[IdentifiedEffect, ...]:
        """Effects that are stated; their values are chosen by the structure, not fitted."""
        return tuple(map(self._effect, self.selected))

    @property
    def alternatives(self) -> tuple[Alternative, ...]:
        """Other sets, the likeliest first."""
        return tuple(self._alternatives())

    def _alternatives(self) -> Iterator[Alternative]:
        posterior, own = self.posterior, self.selected
        credible, logs = posterior.credible(SEARCH.certain), posterior.logs
        for names in [n for n in logs if n != own][:RUNNERS_UP]:
            trial = posterior.trials.get(names, posterior.trials[()])
            why = WhyNot.CREDIBLE if names in credible else WhyNot.LESS_PROBABLE
            why = why if trial.adequate else WhyNot.INADEQUATE
            score, probability = logs[names] - logs[own], float(np.exp(logs[names]))
            yield Alternative(joined(names), "", ALL, score, probability, why, own)
        for names in posterior.unsettled:
            yield Alternative(joined(names), "", ALL, -math.inf, 0.0, WhyNot.UNSETTLED, own)

    def _effect(self, name: str) -> IdentifiedEffect:
        others = tuple(other for other in self.selected if other != name)
        without = others if others in self.posterior.trials else ()
        before, lacking, after = (
            float(np.linalg.norm(self.likelihood.rms(self._simulated(names))))
            for names in ((), without, self.selected)
        )
        bands = self.posterior.trials[self.selected].bands
        nats = bands.log_likelihood - self.posterior.trials[without].bands.log_likelihood
        largest = float(np.sqrt(np.max(bands.power / bands.variance)))
        values = valued((name,), self.model.actuators)[0].values
        return IdentifiedEffect(
            name=name,
            kind="",
            kinds=(("", 1.0),),
            axis=ALL,
            values=tuple(map(_chosen, coupled_form(name).parameters, values)),
            probability=self.posterior.of_effect(name),
            explained_fraction=(lacking**2 - after**2) / before**2,
            evidence=EffectEvidence(lacking, after, nats, synchronous=False, largest_ratio=largest),
        )

    def _simulated(self, names: Names) -> Array:
        return self.posterior.trials[names].simulated

    def _by_axis(self, values: Array) -> dict[str, float]:
        return dict(zip(self.base.axes, map(float, values), strict=True))


def _chosen(parameter: EffectParameter, value: float) -> Value:
    return Value(parameter, value, math.inf)


def diagnose_coupled(
    scanner: CoupledScanner,
    records: Sequence[Record],
    healthy: Sequence[Record],
    progress: ProgressCallback,
) -> CoupledDiagnosis:
    """Find the effects that a model of coupled axes lacks, and identify it anew with them.

    Raises InputError for records that cannot be used, ScanError where the structure cannot be
    identified with the effects found.
    """
    search = CoupledSearch(scanner, diagnosed_records(scanner, records, healthy), progress)
    posterior = search.run()
    model = scanner
    if verdict_of(posterior) in (FOUND, AMBIGUOUS):
        names = posterior.likeliest
        given = list(records) if any(map(changes_linearly, names)) else [*healthy, *records]
        added = (name for name in names if not changes_linearly(name))
        setting = CoupledSetting(
            (*(effect.name for effect in scanner.effects), *added), scanner.linear.order
        )
        model = identify_coupled(given, scanner.axes, setting, progress)
    return CoupledDiagnosis(scanner, model, search.likelihood, posterior)


def verdict_of(posterior: SetPosterior) -> str:
    """Return the verdict of the likeliest set, as that of a single axis."""
    names = posterior.likeliest
    if names == OUTSIDE or not posterior.trials[names].adequate:
        return UNEXPLAINED
    if not names:
        return SUFFICIENT
    certain = all(posterior.of_effect(name) >= SEARCH.certain for name in names)
    return FOUND if certain else AMBIGUOUS
