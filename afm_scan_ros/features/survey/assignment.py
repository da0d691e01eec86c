"""Bags of a survey: found in folders, and each diagnosed in whatever process this runs."""

import hashlib
import math
from collections.abc import Iterable, Iterator
from contextlib import suppress
from functools import lru_cache
from pathlib import Path
from re import Pattern

from attrs import evolve, frozen

from afm_scan_ros.bag.folder import NAME, read_metadata
from afm_scan_ros.bag.mcap_file import is_mcap, is_whole
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
from afm_scan_ros.files.yaml import read_text
from afm_scan_ros.model import Model, load_model

INSTRUMENT = "instrument"
"""Key of ``custom_data`` in ``metadata.yaml``, as 'ros2 bag record --custom-data' writes it."""


@frozen(order=True)
class FoundBag:
    """A bag, a ``name`` of its path, and a digest of names, sizes and times of its files.

    It is ``complete`` where its recorder has finished it.
    """

    path: Path
    name: str
    identity: str
    complete: bool

    @classmethod
    def at(cls, path: Path) -> "FoundBag":
        """Describe the bag at a path."""
        files = sorted(path.iterdir()) if path.is_dir() else [path]
        known = [(file.name, file.stat()) for file in files]
        texts = (f"{name} {of.st_size} {of.st_mtime_ns}" for name, of in known)
        finished = (path / NAME).is_file() if path.is_dir() else is_mcap(path) and is_whole(path)
        return cls(path, _digest(str(path.resolve())), _digest("\n".join(texts)), finished)


def found_bags(paths: Iterable[Path]) -> list[FoundBag]:
    """Find bags: each path is an ``.mcap`` file, a bag's folder, or a folder with bags below it.

    A bag whose files are being renamed or removed at the moment is left out. Raises InputError for
    a path that does not exist, and for a file of another kind.
    """
    places: dict[Path, None] = {}
    for path in paths:
        if not path.exists():
            raise InputError(f"{path} does not exist: give bags, or folders that hold bags")
        if path.is_file() and path.suffix != ".mcap":
            raise InputError(f"{path} is no bag: give a rosbag2 folder or an .mcap file")
        places |= dict.fromkeys(_below(path))
    found = []
    for path in places:
        with suppress(FileNotFoundError):
            found.append(FoundBag.at(path))
    return found


def instrument_of(bag: Path, rule: Pattern[str] | None = None) -> str:
    """Name of a bag's instrument: by a rule, else as ``metadata.yaml`` states it, else its folder.

    A rule is sought in the absolute path, and its first group is the name. Raises InputError where
    it is not found. The folder is the one that the bag lies in.
    """
    path = bag.absolute()
    if rule is not None:
        found = rule.search(path.as_posix())
        if found is None:
            raise InputError(f"{path}: the rule '{rule.pattern}' is not found in this path")
        return found[1]
    with suppress(InputError, OSError):
        if INSTRUMENT in read_text(path / NAME):  # parsing takes milliseconds
            stated = read_metadata(path / NAME).get("custom_data") or {}
            if isinstance(stated, dict) and INSTRUMENT in stated:
                return str(stated[INSTRUMENT])
    return path.parent.name


def _below(path: Path) -> Iterator[Path]:
    if path.is_file() or (path / NAME).is_file() or any(path.glob("*.mcap")):
        yield path
        return
    for each in sorted(path.iterdir()):
        if each.is_dir():
            yield from _below(each)


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()


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
