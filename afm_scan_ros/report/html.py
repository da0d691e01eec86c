"""Self-contained HTML pages: text, tables, figures, and the provenance of what they report."""

from base64 import b64encode
from collections.abc import Iterable, Iterator, Sequence
from html import escape
from io import BytesIO

from matplotlib.figure import Figure

from afm_scan_ros.report.provenance import UNSTATED, Provenance, Source
from afm_scan_ros.report.style import styled
from afm_scan_ros.report.table import Part

_STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; color: #1f2937; max-width: 62rem;
       margin: 2.5rem auto; padding: 0 1rem; }
h1 { font-size: 1.5rem; font-weight: 600; } h2 { font-size: 1.1rem; margin-top: 2.2rem; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; }
th, td { padding: .25rem .9rem .25rem 0; text-align: right; vertical-align: top;
         border-bottom: 1px solid #e5e7eb; white-space: nowrap; }
.long { white-space: normal; }
th { font-weight: 600; color: #6b7280; } td:first-child, th:first-child { text-align: left; }
figure { margin: 1rem 0; } img { max-width: 100%; } figcaption { color: #6b7280; }
pre { background: #f3f4f6; padding: .5rem .8rem; overflow-x: auto; }
.warning { border-left: 4px solid #c4501b; padding-left: .8rem; }
"""


def page(title: str, *parts: str) -> str:
    """Return a whole HTML document made of parts that are HTML already."""
    return (
        f'<!DOCTYPE html>\n<html lang="en">\n<head><meta charset="utf-8">'
        f"<title>{escape(title)}</title><style>{_STYLE}</style></head>\n<body>\n"
        f"<h1>{escape(title)}</h1>\n" + "\n".join(parts) + "\n</body>\n</html>\n"
    )


def heading(text: str) -> str:
    """Return a section's heading."""
    return f"<h2>{escape(text)}</h2>"


def paragraph(text: str) -> str:
    """Return a paragraph."""
    return f"<p>{escape(text)}</p>"


def warning(text: str) -> str:
    """Return a paragraph that stands out."""
    return f'<p class="warning">{escape(text)}</p>'


def command(purpose: str, line: str) -> str:
    """Return a command line with what it is for."""
    return f"<p>{escape(purpose)}</p><pre>{escape(line)}</pre>"


def texts(parts: Iterable[Part]) -> Iterator[str]:
    """Yield sentences as paragraphs, and tables below their titles."""
    for part in parts:
        if isinstance(part, str):
            yield paragraph(part)
        else:
            if part.title:
                yield heading(part.title)
            yield table(part.headings, part.rows)


def table(headings: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table; the first column names the rows. Without headings it has no head."""
    head = _cells("th", headings) if headings else ""
    return f"<table>{head}{''.join(_cells('td', row) for row in rows)}</table>"


def picture(figure: Figure, caption: str) -> str:
    """Return a figure, inside the page, with its caption."""
    return image(png(figure), caption)


@styled
def png(figure: Figure) -> bytes:
    """Draw a figure, as a PNG file has it."""
    stream = BytesIO()
    figure.savefig(stream, format="png", dpi=160)
    return stream.getvalue()


def image(content: bytes, caption: str) -> str:
    """Return a PNG file's content, inside the page, with its caption."""
    data = b64encode(content).decode("ascii")
    return (
        f'<figure><img alt="{escape(caption)}" src="data:image/png;base64,{data}">'
        f"<figcaption>{escape(caption)}</figcaption></figure>"
    )


UNBROKEN = 20
"""Characters of a cell that stay on one line, as a time does."""


def _cells(tag: str, texts: Sequence[str]) -> str:
    kinds = ("" if len(text) <= UNBROKEN else ' class="long"' for text in texts)
    cells = (f"<{tag}{k}>{escape(t)}</{tag}>" for k, t in zip(kinds, texts, strict=True))
    return f"<tr>{''.join(cells)}</tr>"


RECORDS = ("record", "scan", "kind", "recorded", "rate, Hz", "samples", "inverted model")
HASH_DIGITS = 12
"""Of the digest of a model that a record was driven by: as many as its file's name has."""


def provenance_section(found: Provenance) -> Iterator[str]:
    """Yield the section on package, model and records."""
    yield heading("Provenance")
    rows = {
        "written": f"{found.written} by {found.package}",
        "model": found.model,
        "SHA-256 of the model's numbers": found.model_hash,
    }
    yield table((), rows.items())
    yield table(RECORDS, map(_row, found.records))


def _row(record: Source) -> tuple[str, ...]:
    cut = record.samples != record.samples_announced
    of = f" of {record.samples_announced:,}" if cut else ""
    return (
        record.bag,
        record.scan_id,
        record.pattern,
        record.recorded or UNSTATED,
        f"{record.sample_rate:.10g}",
        f"{record.samples:,}{of}",
        (record.model_hash or "none")[:HASH_DIGITS],
    )
