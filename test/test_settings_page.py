"""Numbers that decide stand in settings classes, and these on one page."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest
from attrs import fields

from settings_page import SETTINGS, settings_page

ROOT = Path(__file__).parents[1]
MOST = 619
"""Numbers of the product's modules, to be taken down with each that moves into settings."""


@pytest.mark.parametrize("settings", SETTINGS, ids=lambda each: each.__name__)
def test_each_field_says_what_it_is_and_why(settings: type) -> None:
    page = settings_page()
    for each in fields(settings):
        assert set(each.metadata) == {"unit", "meaning", "source"}, each.name
        assert all(each.metadata.values()), each.name
        assert f"| `{each.name}` | {each.default:g} | {each.metadata['unit']} |" in page


def numbers(path: Path) -> Iterator[str]:
    """Names that a module gives to values with a literal number."""
    for node in ast.parse(path.read_text("utf-8")).body:
        if isinstance(node, ast.Assign | ast.AnnAssign) and node.value is not None:
            literals = [each for each in ast.walk(node.value) if isinstance(each, ast.Constant)]
            if any(type(each.value) in (int, float) for each in literals):
                yield ast.unparse(node).partition("=")[0].strip()


def test_no_number_is_added_outside_settings() -> None:
    files = sorted((ROOT / "afm_scan_ros").rglob("*.py"))
    found = [f"{path.relative_to(ROOT)}: {name}" for path in files for name in numbers(path)]
    assert len(found) <= MOST, "\n".join(found)
