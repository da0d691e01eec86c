"""A parameter has one name: in the report, in ``diagnosis.json`` and in the model file."""

from types import SimpleNamespace

import pytest

from afm_scan_ros.core.diagnosis.result import EffectEvidence, IdentifiedEffect, Value
from afm_scan_ros.core.effects.registry import CATALOGUE, effect_type
from afm_scan_ros.core.model import Added
from afm_scan_ros.files.model_file import added_to
from afm_scan_ros.report.diagnosis_json import diagnosis_document
from afm_scan_ros.report.diagnosis_text import effects, evidence_text

EVIDENCE = EffectEvidence(2e-8, 1e-8, 90.0, synchronous=False, largest_ratio=1.1)
FORMS = [(each.name, form.kind) for each in CATALOGUE for form in each.forms]


def found(name: str, kind: str) -> SimpleNamespace:
    """What of a diagnosis its effects are shown by."""
    form = effect_type(name).form(kind)
    values = tuple(
        Value(parameter, value, 0.1 * abs(value))
        for parameter, value in zip(form.parameters, form.example, strict=True)
    )
    effect = IdentifiedEffect(name, kind, (), "x", values, 0.99, 0.9, EVIDENCE)
    rest = (
        "verdict",
        "noise_floor",
        "rms_before",
        "rms_after",
        "proposal",
        "untested",
        "probabilities",
    )
    return SimpleNamespace(
        effects=(effect,), alternatives=(), cautions=(), **dict.fromkeys(rest, None)
    )


@pytest.mark.parametrize(("name", "kind"), FORMS)
def test_the_names_are_those_of_the_effect(name: str, kind: str) -> None:
    form = effect_type(name).form(kind)
    names = [parameter.name for parameter in form.parameters]
    (in_file,) = added_to([Added(name, kind, form.example)])
    (in_json,) = diagnosis_document(found(name, kind))["effects"]
    assert [*in_file.parameters] == names
    assert [each for each in in_json["parameters"] if each != "kind"] == names
    for parameter in names:
        assert in_file.parameters[parameter]["unit"] == in_json["parameters"][parameter]["unit"]
    if name != "periodic_disturbance":  # which is shown by amplitude and phase
        (table,) = effects(found(name, kind))
        assert [row[2] for row in table.rows] == names


def test_a_parameter_at_the_edge_of_its_range_has_its_name_in_the_evidence() -> None:
    rising, falling = effect_type("slew_limit").form("uneven").parameters
    values = Value(rising, rising.upper, 1.0), Value(falling, 2e3, 1.0)
    effect = IdentifiedEffect("slew_limit", "uneven", (), "x", values, 0.99, 0.9, EVIDENCE)
    message = [each for each in evidence_text(effect) if "at the edge" in each]
    assert [each.split()[1] for each in message] == ["rising_slope"]
