"""The tables of docs/catalogue.md are what the catalogue says."""

import re
from collections.abc import Iterable
from pathlib import Path

from afm_scan_ros.core.effects.effect_type import Form, Parameter
from afm_scan_ros.core.effects.registry import CATALOGUE
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


def harmonics(form: Form, parameter: Parameter) -> str:
    last = [p for p in form.parameters if p.name.startswith(parameter.name.removesuffix("2"))][-1]
    further = f" to `{key_of(last)}`" if parameter.name.endswith("_2") else ""
    return f"`{key_of(parameter)}`{further}"


def parameters() -> str:
    """Harmonics, of which all but the first two have the same names, in the rows of the second."""
    rows = (
        (e.name, form.kind, harmonics(form, p), f"{p.lower:g}", f"{p.upper:g}")
        for e in CATALOGUE
        for form in e.forms
        for p in form.parameters
        if not re.search("_([3-9]|[12][0-9])$", p.name)
    )
    return table(("effect", "kind", "parameter", "from", "to"), rows)


def test_the_document_has_the_table_of_effects() -> None:
    assert effects() in DOCUMENT.read_text("utf-8"), effects()


def test_the_document_has_the_table_of_parameters() -> None:
    assert parameters() in DOCUMENT.read_text("utf-8"), parameters()
