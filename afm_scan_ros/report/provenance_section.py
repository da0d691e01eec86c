"""Provenance as HTML: what a report warns of first, and what it ends with."""

from collections.abc import Iterator

from afm_scan_ros.report import html
from afm_scan_ros.report.provenance import UNSTATED, Provenance, Source

RECORDS = ("record", "scan", "what", "recorded", "Hz", "samples", "drive by model")
DIGITS = 12
"""Of the digest of a model that a record was driven by: as many as its file's name has."""


def warnings(found: Provenance) -> Iterator[str]:
    """Yield what is missing in the records, so that nobody takes a part for the whole."""
    yield from (html.warning(said) for said in found.shortcomings)


def provenance_section(found: Provenance) -> Iterator[str]:
    """Yield the section on package, model and records."""
    yield html.heading("Provenance")
    rows = {
        "written": f"{found.written} by {found.package}",
        "model": found.model,
        "SHA-256 of its numbers": found.model_hash,
    }
    yield html.table((), rows.items())
    yield html.table(RECORDS, map(_row, found.records))


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
        (record.model_hash or "none")[:DIGITS],
    )
