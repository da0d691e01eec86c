"""Pages are made of templates that ship with the package, and no text in them is markup."""

import os
import tomllib
from pathlib import Path

import pytest
from jinja2 import UndefinedError
from setuptools import Distribution, find_namespace_packages
from setuptools.command.build_py import build_py

from afm_scan_ros.report import html
from afm_scan_ros.report.table import Rows

ROOT = Path(__file__).parents[2]
TEMPLATES = sorted((ROOT / "afm_scan_ros").rglob("templates/*.html"))
HOSTILE = "<script>\"a\" 'b' & <b>"
EVERY_PART = """{% extends "base.html" %}
{% from "parts.html" import figure, head, row, table, texts, warnings %}
{% set title = text %}
{% block content %}
{{ warnings([text]) }}{{ head(text) }}{{ row(text) }}{{ texts([text, rows]) }}{{ table(rows) }}
{% call figure(png) %}{{ text }}{% endcall %}
{% endblock %}
"""


@pytest.fixture
def every_part(tmp_path: Path) -> Path:
    (tmp_path / "every_part.html").write_text(EVERY_PART, "utf-8")
    return tmp_path


def test_no_text_is_markup(every_part: Path) -> None:
    def made(text: str) -> str:
        rows = Rows((text,), [(text,)], text)
        return html.page("every_part.html", every_part, text=text, rows=rows, png=b"")

    page = made(HOSTILE)
    assert page.count("&lt;script&gt;") == made("plain").count("plain") == 13
    assert page.count("<") == made(HOSTILE.replace("<", "(")).count("<")
    assert "\"a\" 'b' &" not in page


@pytest.mark.parametrize("template", TEMPLATES, ids=lambda path: path.name)
def test_no_template_calls_a_text_markup(template: Path) -> None:
    text = template.read_text("utf-8")
    assert "safe" not in text
    assert "autoescape" not in text


def test_a_value_that_is_missing_is_an_error(every_part: Path) -> None:
    with pytest.raises(UndefinedError, match="rows"):
        html.page("every_part.html", every_part, text="", png=b"")


def test_a_wheel_holds_every_template(monkeypatch: pytest.MonkeyPatch) -> None:
    """By what setuptools finds of the patterns in pyproject.toml."""
    monkeypatch.chdir(ROOT)
    tool = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["tool"]["setuptools"]
    packages = find_namespace_packages(**tool["packages"]["find"])
    command = build_py(Distribution({"packages": packages, "package_data": tool["package-data"]}))
    command.finalize_options()
    found = [(folder, name) for _, folder, _, names in command.data_files for name in names]
    held = {Path(os.path.normpath(ROOT / folder / name)) for folder, name in found}
    assert TEMPLATES
    assert held >= set(TEMPLATES)
