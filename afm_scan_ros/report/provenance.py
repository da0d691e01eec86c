"""What a report is of: who made it, when, with which model file, and of which records."""

from collections.abc import Iterable
from datetime import UTC, datetime
from pathlib import Path

from attrs import field, frozen

from afm_scan_ros.core.coupled_scanner import CoupledScanner
from afm_scan_ros.core.model import ScannerModel
from afm_scan_ros.core.scan_info import ScanInfo
from afm_scan_ros.files import PACKAGE, version
from afm_scan_ros.files.model_file import model_hash

NANO = 1e-9
DIGITS = 12
"""Of a sample rate: its inverse is what a bag states, and the last digits are the division's."""
UNSTATED = "not stated"
SOURCE = ("record", "scan", "kind", "recorded", "rate, Hz", "samples", "inverted model")
"""Headings of a table of records."""


@frozen
class Source:
    """A record as its bag describes itself; ``shortcomings`` name what is missing in it.

    ``samples`` are those that were read, of as many as the bag announces.
    ``recorded`` (UTC) is the time of its first sample, None where the bag does not know, as after
    an import. ``model_hash`` is that of the model that was inverted, None where none was.
    """

    bag: str
    scan_id: str
    pattern: str
    recorded: str | None
    sample_rate: float = field(metadata={"unit": "hz"})
    samples: int
    samples_announced: int
    model_hash: str | None
    shortcomings: tuple[str, ...]

    @property
    def cells(self) -> tuple[str, ...]:
        """A row of a table of records."""
        announced, read = self.samples_announced, f"{self.samples:,}"
        samples = read if self.samples == announced else f"{read} of {announced:,}"
        rate, inverted = f"{self.sample_rate:.10g}", (self.model_hash or "none")[:12]
        when = self.recorded or UNSTATED
        return self.bag, self.scan_id, self.pattern, when, rate, samples, inverted


@frozen
class Provenance:
    """Who made a report, when (UTC), with which model file, and of which records."""

    package: str
    written: str
    model: str
    model_hash: str
    records: tuple[Source, ...]

    @property
    def shortcomings(self) -> tuple[str, ...]:
        """What is missing in any of the records."""
        return tuple(text for record in self.records for text in record.shortcomings)


def source_of(name: str, info: ScanInfo, samples: int, shortcomings: Iterable[str] = ()) -> Source:
    """Describe a record by what its bag states, and by how many samples were read of it."""
    return Source(
        bag=name,
        scan_id=info.scan_id,
        pattern=info.pattern,
        recorded=_utc(datetime.fromtimestamp(NANO * info.start, UTC)) if info.start else None,
        sample_rate=float(f"{1.0 / info.sample_period:.{DIGITS}g}"),
        samples=samples,
        samples_announced=info.total_samples,
        model_hash=info.model_hash or None,
        shortcomings=tuple(shortcomings),
    )


def provenance_of(
    file: Path | str, model: ScannerModel | CoupledScanner, records: Iterable[Source], now: datetime
) -> Provenance:
    """State what is written ``now`` of records with the model of a file."""
    package = f"{PACKAGE} {version()}"
    return Provenance(package, _utc(now), str(file), model_hash(model), tuple(records))


def heading_lines(found: Provenance) -> str:
    """Return the same as lines of text, for the head of a model file."""
    records = (
        f"Record {of.bag}: scan {of.scan_id}, recorded: {of.recorded or UNSTATED}."
        for of in found.records
    )
    made = f"Written {found.written} by {found.package} from {found.model}."
    digest = f"SHA-256 of that model's numbers: {found.model_hash}"
    return "\n".join((made, digest, *records, *found.shortcomings))


def _utc(time: datetime) -> str:
    return f"{time:%Y-%m-%dT%H:%M:%SZ}"
