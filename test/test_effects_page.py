"""The catalogue page states what the effects' descriptions state."""

from pathlib import Path

import pytest
from attrs import evolve

from afm_scan_ros.core.effects.registry import EFFECTS
from effects_page import effects_page

PAGE = Path(__file__).parents[1] / "docs" / "reference" / "effects.md"
WRITE = "write it: python docs/effects_page.py docs/reference/effects.md"


def test_the_page_is_current() -> None:
    assert PAGE.read_text("utf-8") == effects_page(), WRITE


@pytest.mark.parametrize("place", range(len(EFFECTS)))
@pytest.mark.parametrize("fact", ["equation", "needs", "experiment", "source", "inverse"])
def test_each_fact_of_an_effect_stands_on_the_page(place: int, fact: str) -> None:
    changed = evolve(EFFECTS[place], **{fact: "something else"})
    page = effects_page((*EFFECTS[:place], changed, *EFFECTS[place + 1 :]))
    assert page.count("something else") > effects_page().count("something else")


def test_every_parameter_stands_on_the_page_with_its_bounds() -> None:
    page = effects_page()
    for effect in EFFECTS:
        section = page.split(f"### {effect.name}\n")[1].split("\n### ")[0]
        for form in effect.forms:
            for parameter in form.parameters:
                if not parameter.name[-1].isdigit():
                    unit = "" if parameter.unit == "1" else f" {parameter.unit}"
                    bounds = f"{parameter.lower:g} to {parameter.upper:g}{unit}"
                    assert f"`{parameter.name}` ({bounds}" in section
