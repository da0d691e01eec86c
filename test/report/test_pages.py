"""Pages are made of templates that ship with the package, and no text in them is markup."""

import os
import tomllib
from pathlib import Path

import numpy as np
import pytest
from jinja2 import UndefinedError
from setuptools import Distribution, find_namespace_packages
from setuptools.command.build_py import build_py

from afm_scan_ros.report.interactive import drawn
from afm_scan_ros.report.page import CommandLine, Listing, PageLink, filled
from afm_scan_ros.report.picture import Curve, Panel, Picture
from afm_scan_ros.report.table import Rows

ROOT = Path(__file__).parents[2]
TEMPLATES = sorted((ROOT / "afm_scan_ros").rglob("templates/*.*"))
HOSTILE = "<script>\"a\" 'b' & <b>"
EVERY_PART = """{% extends "base.html" %}
{% from "parts.html" import parts, table %}
{% set title = text %}
{% block content %}
{{ table(rows) }}
{{ parts([text, rows, line, link, listing], drawn) }}{{ parts([picture], drawn) }}
{% endblock %}
"""


@pytest.fixture
def every_part(tmp_path: Path) -> Path:
    (tmp_path / "every_part.html").write_text(EVERY_PART, "utf-8")
    return tmp_path


def test_no_text_is_markup(every_part: Path) -> None:
    def made(text: str) -> str:
        rows = Rows((text,), [(text,)], text)
        panel = Panel([Curve(np.arange(2.0), np.arange(2.0), text)], text, text, text)
        picture = Picture("one", text, [[panel]], variants={text: [[panel]]})
        return filled(
            "every_part.html",
            every_part,
            text=text,
            rows=rows,
            line=CommandLine(text, [text]),
            link=PageLink(text, text),
            listing=Listing([text], [[text, text]], 1),
            picture=picture,
            drawn=drawn([picture]),
        )

    page = made(HOSTILE)
    body, bare = (text[text.index("<body>") :] for text in (page, made("plain")))
    assert bare.count("plain") > 20
    assert body.count("<") == bare.count("<")
    assert HOSTILE not in page
    assert '<script>"a"' not in page


@pytest.mark.parametrize("template", TEMPLATES, ids=lambda path: path.name)
def test_no_template_calls_a_text_markup(template: Path) -> None:
    text = template.read_text("utf-8")
    assert "safe" not in text
    assert "autoescape" not in text


def test_a_value_that_is_missing_is_an_error(every_part: Path) -> None:
    with pytest.raises(UndefinedError, match="rows"):
        filled("every_part.html", every_part, text="", drawn=None)


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
