"""One recording of a survey: read and diagnosed in whatever process this runs."""

import hashlib
import math
from functools import lru_cache
from pathlib import Path

from attrs import evolve, frozen

from afm_scan_ros.bag.record import read_record
from afm_scan_ros.core.diagnosis.result import IdentifiedEffect, Value
from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.record import Record
from afm_scan_ros.diagnosis import Diagnosis, diagnose
from afm_scan_ros.features.survey.recording import (
    EffectValue,
    NamedEffect,
    Recording,
    SurveyedAxis,
    estimates,
)
from afm_scan_ros.files import version
from afm_scan_ros.model import Model, load_model


@frozen
class Assignment:
    """A bag to diagnose: its path, instrument and ``identity``, its model's file and its digest.

    The diagnosis is written to a ``report_folder``, unless there is none.
    """

    bag: str
    instrument: str
    identity: str
    model_file: str
    model: str
    report_folder: str = ""

    def is_of(self, kept: Recording | None) -> bool:
        """Whether this is what was diagnosed already, by this version."""
        known = kept and (kept.identity, kept.model, kept.version)
        same = known == (self.identity, self.model, version())
        return same and (not self.report_folder or Path(self.report_folder).exists())

    def failed(self, error: object) -> Recording:
        """Return the row of a bag that could not be diagnosed, and why."""
        text = " ".join(str(error).split()) or type(error).__name__
        return Recording(
            bag=self.bag,
            instrument=self.instrument,
            identity=self.identity,
            model=self.model,
            version=version(),
            error=text,
        )


def model_digest(file: Path) -> str:
    """SHA-256 of a model's file and of the arrays beside it; raises OSError without a file."""
    digest = hashlib.sha256(file.read_bytes())
    arrays = file.with_suffix(".npz")
    if arrays.exists():
        digest.update(arrays.read_bytes())
    return digest.hexdigest()


def survey_bag(assigned: Assignment) -> Recording:
    """Diagnose a bag. What it lacks for that is the ``error`` of the recording returned.

    Raises OSError where a file cannot be read, which may be another time.
    """
    begun = evolve(assigned.failed(""), error="")
    try:
        record = read_record(assigned.bag)
        model = _model(assigned.model_file, assigned.model)
        found = diagnose(model, [record], parallel=False)  # other bags keep the other cores busy
        if assigned.report_folder:
            found.save(assigned.report_folder)
        return _with_diagnosis(_with_record(begun, record), found)
    except (InputError, ScanError) as error:
        return assigned.failed(error)


@lru_cache(maxsize=16)
def _model(file: str, digest: str) -> Model:
    """Load a model, once for each content."""
    del digest
    return load_model(file)


def _with_record(begun: Recording, record: Record) -> Recording:
    info = record.info
    return evolve(
        begun,
        recorded=info.start if info else 0,
        scan_id=info.scan_id if info else "",
        motion=_motion(record),
        samples=len(record.drive),
        sample_rate=1.0 / record.sample_period,
        shortcomings=record.shortcomings,
    )


def _motion(record: Record) -> str:
    """Digest of what fixes the path of a recording; its own where the bag does not state it."""
    info = record.info
    known = (
        (info.spec, info.pattern, info.inverses, info.model_hash, info.total_samples)
        if info
        else record.name
    )
    return hashlib.sha256(repr((known, record.sample_period)).encode()).hexdigest()


def _with_diagnosis(recording: Recording, found: Diagnosis) -> Recording:
    by_axis = found.scanner_diagnosis.by_axis
    axes = (
        SurveyedAxis(
            name, each.limit, each.rms_before, tuple(estimates(each.evidence[0], each.chain))
        )
        for name, each in by_axis.items()
    )
    effects = tuple(map(_named, found.effects))
    return evolve(recording, verdict=found.verdict, axes=tuple(axes), effects=effects)


def _named(effect: IdentifiedEffect) -> NamedEffect:
    values = tuple(map(_value, effect.values))
    return NamedEffect(effect.name, effect.kind, effect.axis, effect.probability, values)


def _value(found: Value) -> EffectValue:
    known = found.interval if math.isfinite(found.halfwidth) else (None, None)
    return EffectValue(found.parameter.name, found.parameter.unit, found.value, *known)
