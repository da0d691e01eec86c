"""The catalogue of sentences: each that the code names is there, and each there is named."""

import ast
import re
from pathlib import Path

import pytest
import yaml
from jinja2 import UndefinedError

import afm_scan_ros
from afm_scan_ros.report.sentences import WORDS, sentence

PACKAGE = Path(afm_scan_ros.__file__).parent
FILES = sorted(PACKAGE.rglob("sentences.yaml"))
TEXTS = {
    f"{section}.{name}": text
    for file in FILES
    for section, texts in yaml.safe_load(file.read_text("utf-8")).items()
    for name, text in texts.items()
}
SAYING = {"sentence", "said"}
"""Names of the catalogues in the code."""


def named() -> set[str]:
    """Patterns of the codes in the package, with ``.*`` where one depends on a value."""
    found = set()
    for path in PACKAGE.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            if isinstance(node, ast.Constant) and isinstance(node.value, str):
                found.add(re.escape(node.value))
            elif isinstance(node, ast.JoinedStr):
                parts = (getattr(each, "value", "") for each in node.values)
                found.add("".join(re.escape(p) if isinstance(p, str) else ".*" for p in parts))
    return found


def test_each_sentence_is_said() -> None:
    sections = {code.partition(".")[0] for code in TEXTS}
    patterns = [re.compile(each) for each in named() if each.partition("\\.")[0] in sections]
    assert [code for code in TEXTS if not any(each.fullmatch(code) for each in patterns)] == []


def test_each_sentence_that_is_said_is_there() -> None:
    calls = (
        node.args[0].value
        for path in PACKAGE.rglob("*.py")
        for node in ast.walk(ast.parse(path.read_text("utf-8")))
        if isinstance(node, ast.Call) and ast.unparse(node.func) in SAYING
        if isinstance(node.args[0], ast.Constant)
    )
    assert sorted(set(calls) - set(TEXTS)) == []


@pytest.mark.parametrize("code", TEXTS)
def test_a_sentence_is_a_template(code: str) -> None:
    WORDS.from_string(TEXTS[code])


def test_a_value_that_is_not_given_is_an_error() -> None:
    with pytest.raises(UndefinedError):
        sentence("loop.failed", number=1)
