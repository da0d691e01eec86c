"""Diagnosis of one axis: its residual, the posterior over sets of effects, and the verdict.

A mechanism outside the catalogue may be fitted by an effect in one part of a record at the cost of
another. So each part may have its own amount of the effect, and the gain is compared with chance:
Chow's test for a change of coefficients (Econometrica 28, 1960, 591).

The model's own error of a periodic motion lies at multiples of its repetition rate. A disturbance
within one over the record's length of such a multiple (Rayleigh) cannot be distinguished from it,
unless another record shows it whose drive does not repeat at this rate.
"""

from collections.abc import Iterator, Sequence
from functools import partial
from itertools import zip_longest

import numpy as np
from attrs import evolve, frozen

from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.diagnosis.candidates import CandidateFitter, FittedCandidates
from afm_scan_ros.core.diagnosis.evidence import Evidence
from afm_scan_ros.core.diagnosis.free_directions import with_free_directions
from afm_scan_ros.core.diagnosis.preparation import evidence_of
from afm_scan_ros.core.diagnosis.records import AxisSignals
from afm_scan_ros.core.diagnosis.search import OUTSIDE, ModelSearch, Selection
from afm_scan_ros.core.diagnosis.settings import PARTING, SEARCH, VARIANCE
from afm_scan_ros.core.diagnosis.structure import refit_of
from afm_scan_ros.core.effects.effect_type import EffectForm
from afm_scan_ros.core.effects.residual_features import ResidualFeatures, prominent_lines
from afm_scan_ros.core.model import CONFIDENT, ScannerModel
from afm_scan_ros.core.record import Record
from afm_scan_ros.core.scanner import chain_of
from afm_scan_ros.core.types import Array, Tally, floats


def time_varying(
    evidence: Sequence[Evidence], chain: Chain, selected: FittedCandidates
) -> Iterator[int]:
    """Yield the places of the effects whose amount changes by more than chance explains."""
    left = [each.normalised_residual(selected.extended(chain)) for each in evidence]
    for place in range(len(selected.candidates)):
        less = selected.without(chain, place)
        taken = [
            each.normalised_residual(less) - rest for each, rest in zip(evidence, left, strict=True)
        ]
        parts = [part for pair in zip(taken, left, strict=True) for part in _time_parts(*pair)]
        gained = sum(_explained_power(part) for part in parts) - _explained_power(np.hstack(parts))
        by_chance = CONFIDENT**2 * VARIANCE.along * len(evidence)
        allowed = by_chance + SEARCH.largest_change * _power(taken)
        if gained > allowed:
            yield place


def _time_parts(taken: Array, left: Array) -> list[Array]:
    """Parts (2, m) of what an effect explains of a record and of what is left, both (n,)."""
    return np.array_split(np.stack((taken, left)) / np.sqrt(len(left)), SEARCH.parts, axis=1)


def _explained_power(part: Array) -> float:
    """Power of what is left that another amount of the effect explains.

    A ridge term assumes changes no larger than the amount itself, so an effect that is hardly
    excited in a part explains nothing there.
    """
    taken, left = part
    return float(taken @ left) ** 2 / (float(taken @ taken) + VARIANCE.along)


def _power(taken: Sequence[Array]) -> float:
    return sum(float(np.mean(each**2)) for each in taken)


def synchronous_places(selected: FittedCandidates, evidence: Sequence[Evidence]) -> Iterator[int]:
    """Yield the places of the disturbances that are synchronous with the drive in every record."""
    views = [each.playback.view for each in evidence]
    for place, candidate in enumerate(selected.candidates):
        if any(parameter.located for parameter in candidate.form.parameters):
            rate, sizes = _drive_tones(candidate.form, selected.fit.rows[:, selected.part(place)])
            seen = np.argwhere(sizes >= SEARCH.present * sizes.max())
            if all(repeats(views[record], (k + 1) * rate) for record, k in seen):
                yield place


def _drive_tones(form: EffectForm, rows: Array) -> tuple[float, Array]:
    """Frequency (Hz) of the first harmonic, and the size of each in each record (r, harmonics)."""
    rate = rows[0, [p.name for p in form.parameters].index("frequency")]
    amounts = rows[:, [p.own for p in form.parameters]].reshape(len(rows), -1, 2)
    return float(rate), np.linalg.norm(amounts, axis=2)


def repeats(view: AxisSignals, frequency: float) -> bool:
    """Whether the drive of a record repeats at a frequency, or at one that divides it."""
    if not view.rates:
        return False
    rates = np.array(view.rates)
    multiple = np.maximum(np.round(frequency / rates), 1.0)
    return bool(np.any(np.abs(frequency - multiple * rates) < 1.0 / view.duration))


SUFFICIENT, FOUND, AMBIGUOUS = "model_sufficient", "effect_found", "ambiguous"
INSUFFICIENT, UNEXPLAINED = "insufficient_excitation", "unexplained"


@frozen(eq=False)
class AxisDiagnosis:
    """Result for one axis. ``chain`` is the model's, ``extended`` has the selected effects too.

    ``held_out`` has their values fitted to every other stretch of the records. The stretches
    between give the residual on data that the fit did not see. ``time_varying`` are the places of
    selected effects whose amount changes over the records.
    """

    axis: str
    evidence: tuple[Evidence, ...]
    chain: Chain
    extended: Chain
    held_out: Chain
    selection: Selection
    time_varying: tuple[int, ...]

    @property
    def verdict(self) -> str:
        """The verdict, one of the names in ``diagnosis.json``."""
        selection, posterior = self.selection, self.selection.posterior
        unnamed = posterior.likeliest == OUTSIDE
        if unnamed or not self._adequate or self.time_varying:
            return UNEXPLAINED
        if selection.selected is None:
            return INSUFFICIENT if self._still else SUFFICIENT
        certain = all(
            posterior.of_effect(name) >= SEARCH.certain for name in selection.selected.names
        )
        doubtful = not certain or self.synchronous_places or self.like_own_error
        return AMBIGUOUS if doubtful else FOUND

    @property
    def _adequate(self) -> bool:
        """Whether no cell lacks anything.

        The stated error of a formula holds inside the ranges of its parameters. At an end of a
        range the formula counts as exact. An effect must leave as little as if the model's error
        were well known: the more of it were left, the less would it tell from that error.
        """
        selected, reached = self.selection.selected, self.selection.reached
        if selected is None:
            return reached.adequate
        reached = evolve(reached, known=np.maximum(reached.known, VARIANCE.known))
        if selected.at_end:
            exact = np.concatenate([each.variance.total for each in self.evidence])
            reached = evolve(reached, variance=exact)
        return reached.adequate

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
    def like_own_error(self) -> bool:
        """Whether a selected effect may be the model's error, which is not known for the motion.

        A hysteresis that was identified from other loops errs as one whose gain has changed. A
        disturbance of which a line lasts between the motion's harmonics is no such error.
        """
        selected = self.selection.selected
        every = selected.candidates if selected else ()
        tones = all(any(p.located for p in each.form.parameters) for each in every)
        lasting = (each.lasting_lines(self.chain) for each in self.evidence)
        return self.untested and not (tones and any(lasting))

    @property
    def final(self) -> Chain:
        """Chain with the effects that are stated; the model's where none is."""
        return self.extended if self.verdict in (FOUND, AMBIGUOUS) else self.chain

    @property
    def deviations(self) -> tuple[float, ...]:
        """Standard deviations by which the model's free directions were moved."""
        return floats(self.selection.reached.deviations)

    @property
    def ratio_before(self) -> tuple[Array, ...]:
        """Rms residual of the model over the detection limit, (bands,) of each record."""
        return tuple(each.ratio(self.chain) for each in self.evidence)

    @property
    def ratio_after(self) -> tuple[Array, ...]:
        """The same of the extended model."""
        return tuple(each.ratio(self.final) for each in self.evidence)

    @property
    def rms_before(self) -> float:
        """Rms residual (m) of the model on the held-out stretches of all records."""
        return self.rms(self.chain)

    @property
    def rms_after(self) -> float:
        """The same of the extended model, its values fitted to the other stretches."""
        return self.rms(self.chain if self.final is self.chain else self.held_out)

    def rms(self, chain: Chain) -> float:
        """Rms residual (m) of a chain on the held-out stretches of all records."""
        squares = [np.mean(e.residual(chain)[~e.fitted] ** 2) for e in self.evidence]
        return float(np.sqrt(np.mean(squares)))

    @property
    def limit(self) -> float:
        """Rms of the detection limit over all records, m."""
        return float(np.sqrt(np.mean([e.limit.total**2 for e in self.evidence])))

    @property
    def _still(self) -> bool:
        return all(each.still(self.chain) for each in self.evidence)


def diagnose_axis(
    axis: str,
    model: ScannerModel,
    observations: Sequence[Record],
    tally: Tally,
    *,
    structure: bool = False,
) -> AxisDiagnosis:
    """Find the effects that the model of one axis lacks, from the residuals of the records.

    Where its ``structure`` is traced, the model is one that counts as exact. An effect may be taken
    for an initial state of the hysteresis. Where records seem to begin in such a state and
    something is lacking, they are also taken to begin depolarised.
    Raises InputError where the model states no model discrepancy.
    """
    chain = chain_of(model.axis(axis))
    given = [evidence_of(axis, model, each, i) for i, each in enumerate(observations)]
    evidence = tuple(given) if structure else with_free_directions(given, chain)
    nuisance = (refit_of(model.axis(axis)),) if structure else ()
    search = partial(_search, chain=chain, tally=tally, nuisance=nuisance)
    fresh = tuple(each.from_depolarised(chain) for each in evidence)
    if all(one is other for one, other in zip(evidence, fresh, strict=True)):
        return _diagnosed(axis, search(evidence))
    return _diagnosed(axis, _likelier([search(each) for each in (evidence, fresh)]))


def _search(
    evidence: tuple[Evidence, ...],
    chain: Chain,
    tally: Tally,
    nuisance: tuple[EffectForm, ...],
) -> ModelSearch:
    fitter = CandidateFitter(evidence, chain, nuisance)
    return ModelSearch(fitter, lambda c: features_of(fitter.decimated_evidence, evidence, c), tally)


def _likelier(searches: Sequence[ModelSearch]) -> ModelSearch:
    """Return the search of the likelier initial state, once single effects are fitted."""
    if searches[0].selection.without.cells.adequate:
        return searches[0]
    for each in searches:
        each.grow()
    return max(searches, key=lambda each: each.selection.posterior.evidence)


def _diagnosed(axis: str, search: ModelSearch) -> AxisDiagnosis:
    selection, fitter = search.select(), search.fitter
    selected, chain = selection.selected, fitter.chain
    return AxisDiagnosis(
        axis=axis,
        evidence=fitter.evidence,
        chain=chain,
        extended=selected.extended(chain) if selected else chain,
        held_out=fitter.on_fitted_stretches(selected) if selected else chain,
        selection=selection,
        time_varying=tuple(_time_varying(fitter.evidence, chain, selected)),
    )


def _time_varying(
    evidence: tuple[Evidence, ...], chain: Chain, selected: FittedCandidates | None
) -> Iterator[int]:
    if selected is None:
        return iter(())
    moved = [each.with_base(selected.cells.deviations) for each in evidence]
    return time_varying(moved, chain, selected)


def features_of(
    evidence: Sequence[Evidence], whole: Sequence[Evidence], chain: Chain
) -> ResidualFeatures:
    """Features of the record whose residual exceeds its detection limit most.

    Lines that the noise of the ``whole`` records does not explain come first. The record's own come
    second to those of the longest record, which tells frequencies best: a frequency that is wrong
    by more than one over a record's length explains nothing of it.
    """
    loudest = max(evidence, key=lambda e: float(np.mean(e.normalised_residual(chain) ** 2)))
    view, residual = loudest.playback.view, loudest.residual(chain)
    longest = max(evidence, key=lambda e: e.playback.view.duration)
    both = dict.fromkeys((longest, loudest))
    lines = (prominent_lines(e.residual(chain), e.playback.view.sample_period) for e in both)
    own = (line for rank in zip_longest(*lines) for line in rank if line is not None)
    beyond = tuple(line for each in whole for line in each.lasting_lines(chain)[: PARTING.starts])
    return ResidualFeatures(
        view.sample_period,
        view.drive,
        view.measured,
        residual,
        view.other,
        prominent=(*beyond, *own),
        beyond_noise=bool(beyond),
    )
