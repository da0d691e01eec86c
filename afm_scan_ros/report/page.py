"""What a report says, in the order in which it is read: the answer, what to do next, evidence.

And what it is of: who made it, when, with which model file, and of which records. Pages are
self-contained HTML from templates, in which no text is markup.
"""

import shlex
from collections.abc import Iterable, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import TypeAlias

from attrs import field, frozen
from jinja2 import Environment, FileSystemLoader, StrictUndefined

from afm_scan_ros.core.coupled_scanner import CoupledScanner
from afm_scan_ros.core.model import ScannerModel
from afm_scan_ros.core.scan_info import ScanInfo
from afm_scan_ros.files import PACKAGE, version
from afm_scan_ros.files.model_file import model_hash
from afm_scan_ros.files.paths import write_text
from afm_scan_ros.report.picture import Picture
from afm_scan_ros.report.table import Rows

TEMPLATES = Path(__file__).parent / "templates"


def filled(name: str, folder: Path = TEMPLATES, **values: object) -> str:
    """Return a template of a folder filled with values; it may extend those of this package.

    Each text among the values is escaped. A value that a template names and that is not given is
    an error.
    """
    templates = Environment(
        loader=FileSystemLoader([folder, TEMPLATES]),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    templates.tests["kind"] = lambda part, name: type(part).__name__ == name
    templates.filters["zip"] = zip
    return templates.get_template(name).render(values)


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
        recorded=_utc(datetime.fromtimestamp(1e-9 * info.start, UTC)) if info.start else None,
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


@frozen
class PageLink:
    """A link to another page."""

    text: str
    target: str


@frozen
class CommandLine:
    """A command of ``afm-scan`` by its words, and what it serves."""

    purpose: str
    words: Sequence[object]

    @property
    def line(self) -> str:
        """The command as a shell takes it, whatever the names of files."""
        return shlex.join(["afm-scan", *map(str, self.words)])


@frozen
class Listing:
    """A table of any length, which a page sorts, filters and shows in parts.

    The first ``shown`` columns are those of the table; a row that is opened shows every one. A row
    begins with the address of its own report, which may be empty.
    """

    headings: Sequence[str]
    rows: Sequence[Sequence[str | float]]
    shown: int


Part: TypeAlias = str | Rows | Picture | PageLink | CommandLine | Listing


@frozen
class Section:
    """A part of the evidence, folded until it is ``opened``."""

    title: str
    parts: Sequence[Part]
    opened: bool = False


@frozen
class ReportPage:
    """A report: ``answer`` is two sentences, ``picture`` shows them, ``warnings`` limit them."""

    title: str
    answer: Sequence[str]
    picture: Picture | None
    next_steps: Sequence[str | CommandLine]
    evidence: Sequence[Section]
    warnings: Sequence[str] = ()
    provenance: Provenance | None = None

    @property
    def sections(self) -> list[Section]:
        """The evidence, and where it is from."""
        made = self.provenance
        if made is None:
            return list(self.evidence)
        of = [
            ("written", f"{made.written} by {made.package}"),
            ("model", made.model),
            ("SHA-256 of the model's numbers", made.model_hash),
        ]
        tables = [Rows((), of), Rows(SOURCE, [record.cells for record in made.records])]
        return [*self.evidence, Section("Provenance", tables)]

    @property
    def pictures(self) -> list[Picture]:
        """Every picture, that of the answer first."""
        parts = [self.picture, *(part for section in self.evidence for part in section.parts)]
        return [part for part in parts if isinstance(part, Picture)]

    def page(self) -> str:
        """Return the report as one HTML page that needs nothing else."""
        from afm_scan_ros.report.interactive import drawn  # noqa: PLC0415 - a page alone needs it

        return filled("report.html", report=self, drawn=drawn(self.pictures))

    def write(self, file: Path, figures: str | None) -> None:
        """Write the page, and beside it each picture as a file of a format, if one is named."""
        write_text(file, self.page())
        if figures is None:
            return
        from afm_scan_ros.report.paper import paper_figure, save  # noqa: PLC0415 - by matplotlib

        for picture in (each for of in self.pictures for each in of.singly()):
            path = file.with_name(f"{file.stem}_{picture.name}.{figures}")
            save(paper_figure(picture), path)
