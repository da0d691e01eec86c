"""The tables of docs/catalogue.md are what the catalogue says."""

from collections.abc import Iterable
from pathlib import Path

from afm_scan_ros.core.catalogue import CATALOGUE
from afm_scan_ros.files.added_effects import key_of

DOCUMENT = Path(__file__).parents[3] / "docs" / "catalogue.md"


def table(heads: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    heads = list(heads)
    lines = (heads, ["---"] * len(heads), *rows)
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def effects() -> str:
    heads = ("effect", "equation", "needs", "mistaken for", "experiment", "feedforward")
    remedies = {"feedforward": "undoes it", "partly": "in part", "none": "cannot"}
    rows = (
        (
            f"`{e.name}`",
            e.equation,
            e.needs,
            ", ".join(e.confusable),
            e.experiment,
            f"{remedies[e.remedy]}: {e.advice}",
        )
        for e in CATALOGUE
    )
    return table(heads, rows)


def parameters() -> str:
    rows = (
        (e.name, form.kind, f"`{key_of(p)}`", f"{p.lower:g}", f"{p.upper:g}")
        for e in CATALOGUE
        for form in e.forms
        for p in form.parameters
    )
    return table(("effect", "kind", "parameter", "from", "to"), rows)


def test_the_document_has_the_table_of_effects() -> None:
    assert effects() in DOCUMENT.read_text("utf-8"), effects()


def test_the_document_has_the_table_of_parameters() -> None:
    assert parameters() in DOCUMENT.read_text("utf-8"), parameters()
