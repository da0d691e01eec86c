"""Diagnosis of records: the effects that a model lacks."""

from collections.abc import Iterable, Sequence
from datetime import UTC, datetime
from functools import cached_property
from itertools import combinations
from pathlib import Path

import numpy as np
from attrs import field, frozen

from afm_scan_ros.core.arguments import MODEL, RECORDS, all_of_type, of_type, positive
from afm_scan_ros.core.diagnosis.cautions import refuse_mismatch
from afm_scan_ros.core.diagnosis.coupled.diagnosis import CoupledDiagnosis, diagnose_coupled
from afm_scan_ros.core.diagnosis.diagnosis import ScannerDiagnosis
from afm_scan_ros.core.diagnosis.diagnosis import diagnose as diagnose_scanner
from afm_scan_ros.core.diagnosis.experiments import LONGEST
from afm_scan_ros.core.diagnosis.residual_report import ResidualReport, report_residual
from afm_scan_ros.core.diagnosis.result import Alternative, IdentifiedEffect
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.record import Record
from afm_scan_ros.core.scan_info import ScanInfo
from afm_scan_ros.core.types import AXES, ProgressCallback
from afm_scan_ros.files.paths import path_of
from afm_scan_ros.identification import named
from afm_scan_ros.model import Model
from afm_scan_ros.report import diagnosis_page
from afm_scan_ros.report.diagnosis_text import (
    caution_text,
    next_experiment,
    next_steps,
    result,
    unexplained_text,
)
from afm_scan_ros.report.page import provenance_of, source_of
from afm_scan_ros.report.table import Part

SAME = 1e-6
"""Of a record's range: text with seven digits keeps as much, and no sensor repeats itself so."""


def refuse_same(records: Sequence[Record]) -> None:
    """Refuse two records of one scan: copies, parts, or what two recorders have of it.

    They are compared by the scan's id and beginning, and where these are unknown by the samples.
    Raises InputError, which names both.
    """
    for record, again in combinations(records, 2):
        info, other = info_of(record), info_of(again)
        stated = info.start != 0 and (info.scan_id, info.start) == (other.scan_id, other.start)
        if stated or _alike(record, again):
            raise InputError(
                f"{again.name}: holds the same scan as {record.name}, which adds nothing new and"
                " would count twice: give one of them"
            )


def _alike(record: Record, again: Record) -> bool:
    """Whether both hold the same samples as far as the shorter one reaches."""
    if record.sample_period != again.sample_period:
        return False
    both = min(len(each.displacement) for each in (record, again))
    pairs = ([each.signals(a)[1][:both] for each in (record, again)] for a in AXES)
    return all(np.abs(one - other).max() <= SAME * np.ptp(one) for one, other in pairs)


HEADING = (
    "A scanner's model with the effects that a diagnosis identified. The verdict is in"
    " diagnosis.json beside it. Where it is ambiguous, another effect may be the cause."
)
FEWEST = 1000
"""Least number of samples for a diagnosis."""


@frozen(eq=False, slots=False)
class Diagnosis:
    """Result of ``diagnose``: the effects that a model lacks.

    ``verdict`` is "model_sufficient", "effect_found", "ambiguous", "insufficient_excitation" or
    "unexplained"; ``effects`` are those found, ``alternatives`` others that explain the records,
    ``next_experiment`` a record that would distinguish them, if any.
    ``model`` is the model extended by the effects that were found, ``records`` are those diagnosed.
    """

    model: Model
    records: tuple[Record, ...] = field(repr=False)
    _base: Model = field(repr=False)
    _found: ScannerDiagnosis | CoupledDiagnosis = field(repr=False)

    @property
    def scanner_diagnosis(self) -> ScannerDiagnosis:
        """The diagnosis of each axis; raises InputError of coupled axes."""
        if isinstance(self._found, CoupledDiagnosis):
            raise InputError(f"{self._base.origin}: of coupled axes no residual is described")
        return self._found

    @cached_property
    def residual_report(self) -> ResidualReport:
        """All that ``diagnosis.json`` and the report state; raises InputError of coupled axes.

        The residual is described when this is first asked for, which takes longer than a diagnosis
        that finds nothing.
        """
        return report_residual(self.scanner_diagnosis)

    @property
    def verdict(self) -> str:
        """Return the verdict, in the words of ``diagnosis.json``.

        It is "model_sufficient", "effect_found", "ambiguous", "insufficient_excitation" or
        "unexplained".
        """
        return self._found.verdict

    @property
    def effects(self) -> tuple[IdentifiedEffect, ...]:
        """Effects found: each has ``name``, ``kind``, ``axis``, ``probability`` and ``values``.

        Each of the values has ``parameter.name``, ``value`` and ``interval``, of 95 %.
        """
        return self._found.effects

    @property
    def alternatives(self) -> tuple[Alternative, ...]:
        """Effects that were considered: each has ``name``, ``axis``, ``score``, ``why_not``."""
        return self._found.alternatives

    @property
    def probabilities(self) -> dict[str, dict[str, float]]:
        """Probability of each set of effects, by axis; names are joined by " + ", or "none"."""
        return self._found.probabilities

    @property
    def next_experiment(self) -> str | None:
        """What to record to resolve an ambiguous case, in a sentence; None where nothing is."""
        found = self._found
        if isinstance(found, CoupledDiagnosis):
            return diagnosis_page.next_coupled_record(found)
        return next_experiment(found)

    @property
    def summary(self) -> tuple[Part, ...]:
        """Sentences and tables that say what was found, as on the terminal and in the report."""
        found = self._found
        if isinstance(found, CoupledDiagnosis):
            said = list(diagnosis_page.coupled_result(found))
            steps = diagnosis_page.coupled_next_steps(found)
        else:
            said = [*result(found), *unexplained_text(self.residual_report)]
            steps = next_steps(found)
        return (*said, *(f"next: {step}" for step in steps))

    @property
    def cautions(self) -> tuple[str, ...]:
        """Limitations of the verdict, in sentences."""
        found = self._found
        return (
            () if isinstance(found, CoupledDiagnosis) else tuple(map(caution_text, found.cautions))
        )

    def save(self, folder: Path | str, figures: str | None = None) -> None:
        """Write diagnosis.json, model.extended.yaml and report.html to a folder.

        ``figures``, one of pdf, svg and png, has the report's pictures written beside it, of which
        coupled axes have none. Folders that are missing are made. Raises InputError where a file
        cannot be written.
        """
        into = path_of(folder, "diagnosis")
        sources = [
            source_of(record.name, info_of(record), len(record.drive), record.shortcomings)
            for record in self.records
        ]
        base = self._base.coupled if self._base.is_coupled else self._base.scanner
        of = provenance_of(self._base.origin, base, sources, datetime.now(UTC))
        if isinstance(self._found, CoupledDiagnosis):
            diagnosis_page.write_coupled(into, self._found, HEADING, of)
            return
        diagnosis_page.write_diagnosis(into, self.residual_report, HEADING, of, figures)


def diagnose(
    model: Model,
    records: Iterable[Record],
    healthy: Iterable[Record] = (),
    progress: ProgressCallback | None = None,
    longest: float = LONGEST,
    *,
    parallel: bool = True,
    structure: bool = False,
) -> Diagnosis:
    """Find the effects that explain the residual of a model in records.

    Parameters
    ----------
    model
        With its model discrepancy, which ``identify`` measures on held-out records.
    records
        Of one scanner, each of another scan, of 1000 samples or more. The axes that the model and
        every record hold are diagnosed. A model of coupled axes takes records as ``identify`` does:
        of one or more amplitudes, each with more realisations than axes; they may exceed the
        amplitudes of the model.
    healthy
        Further records of the scanner while nothing was wrong with it, as ordinary scans: they add
        the model's error on motion of their kind to the model. Of coupled axes they are best what
        the model was identified from; without, the model's stated error stands for its amplitudes.
    progress
        Is called with the effects that are being fitted: text that also has how many sets are
        ``done`` of a ``total``, to which more may come. ``timed(print)`` shows it with the time.
    longest
        Length of a proposed experiment, at most, s.
    parallel
        Diagnose the axes at the same time, in threads. In turn, they take less time of the cores,
        and longer. Coupled axes are diagnosed together.
    structure
        Whether to ask what the structure of the model lacks, and not what has changed since it was
        identified. Its stated error then explains no residual, and its vibration is fitted anew
        beside each effect. An effect is named only where hardly anything is left beside it.

    Returns
    -------
    Diagnosis
        Verdict, effects with intervals and probabilities, and the model extended by them. The
        structure of coupled axes is identified anew with the effects found, from ``healthy`` and
        ``records``, or from ``records`` alone where its linear response has changed.

    Raises
    ------
    InputError
        Where an argument is of another type, there is no record, a record is of another scanner or
        unit or is given twice, its drive leaves the range that the model was identified in, no axis
        is in all, or the model states no model discrepancy. Of coupled axes, as by ``identify``.
    ScanError
        Where the structure of coupled axes cannot be identified with the effects found.

    Examples
    --------
    >>> import numpy as np
    >>> import afm_scan_ros as afm
    >>> model = afm.load_model()
    >>> spec = afm.ScanSpec(range_x=10e-6, range_y=10e-6, lines=4, line_rate=20.0, y_step=2e-3)
    >>> drive = model.invert(afm.trajectory(spec), spec.sample_period)
    >>> moved = model.predict(drive, spec.sample_period)
    >>> measured = moved + 2e-9 * np.random.default_rng(1).standard_normal(moved.shape)
    >>> record = afm.Record(drive, measured, spec.sample_period, axes=("x", "y"), scan=spec)
    >>> afm.diagnose(model, [record]).verdict
    'model_sufficient'
    """
    of_type(Model, "model", model, MODEL)
    given = tuple(named(all_of_type(Record, "records", records, RECORDS)))
    longest = positive("longest", longest, "in s, as 60.0")
    well = tuple(named(all_of_type(Record, "healthy", healthy, RECORDS), "healthy record"))
    if model.is_coupled:
        if structure:
            raise InputError(f"{model.origin}: is of coupled axes: leave out structure")
        return _coupled(model, given, well, progress or (lambda _: None))
    scanner = model.scanner
    for record in (*given, *well):
        refuse_short(record)
        record.warn()
        refuse_mismatch(scanner, record)
    refuse_same((*given, *well))
    progress = progress or (lambda _: None)
    try:
        found = diagnose_scanner(
            scanner, given, progress, well, longest, parallel=parallel, structure=structure
        )
    except InputError as error:
        raise InputError(f"{model.origin}: {error}") from error
    extended = Model(found.model, f"{model.origin}, extended by a diagnosis")
    return Diagnosis(extended, given, model, found)


def _coupled(
    model: Model, given: tuple[Record, ...], well: tuple[Record, ...], progress: ProgressCallback
) -> Diagnosis:
    if not given:
        raise InputError("no record is given: give realisations of one amplitude or more")
    for record in (*given, *well):
        if record.axes != model.axes:
            raise InputError(
                f"{record.name}: its axes are {', '.join(record.axes)}, and those of the model"
                f" {', '.join(model.axes)}: give records of the model's axes, in its order"
            )
        record.warn()
    found = diagnose_coupled(model.coupled, given, well, progress)
    extended = Model(found.model, f"{model.origin}, extended by a diagnosis")
    return Diagnosis(extended, given, model, found)


def refuse_short(record: Record) -> None:
    """Raise InputError where a record is too short for a diagnosis."""
    if len(record.drive) < FEWEST:
        fix = "; ".join((f"record {FEWEST} or more", *record.shortcomings))
        raise InputError(
            f"{record.name}: holds {len(record.drive)} samples of drive and displacement; {fix}"
        )


def info_of(record: Record) -> ScanInfo:
    """What a record's bag states of it; of one from arrays what is known."""
    if record.info is not None:
        return record.info
    kind = record.scan.pattern if record.scan else record.kind or "record"
    return ScanInfo(record.name, 0, kind, record.sample_period, len(record.drive), record.scan)
