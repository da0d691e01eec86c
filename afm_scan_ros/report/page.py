"""What a report says, in the order in which it is read: the answer, what to do next, evidence.

Pages are self-contained HTML from templates, in which no text is markup.
"""

import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import TypeAlias

from attrs import frozen
from jinja2 import Environment, FileSystemLoader, StrictUndefined

from afm_scan_ros.files.paths import write_text
from afm_scan_ros.report.picture import Picture
from afm_scan_ros.report.provenance import SOURCE, Provenance
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
