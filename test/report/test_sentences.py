"""What is written for people is short: at most 25 words a sentence."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

import afm_scan_ros

PACKAGE = Path(afm_scan_ros.__file__).parent
FOLDERS = ("report", "cli", "files", "nodes")
WORDS = 25
HEADING = re.compile(r"[.:;!?]\s+|\n\s*\n")
"""Where a sentence, or a part before its remedy, ends."""


def texts(tree: ast.Module) -> Iterator[tuple[int, str]]:
    """Yield every string and f-string, an expression in it standing for one word."""
    for node in ast.walk(tree):
        if isinstance(node, ast.JoinedStr):
            parts = [v.value if isinstance(v, ast.Constant) else "X" for v in node.values]
            yield node.lineno, "".join(map(str, parts))
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield node.lineno, node.value


@pytest.mark.parametrize("folder", FOLDERS)
def test_a_sentence_has_at_most_25_words(folder: str) -> None:
    found = [
        f"{path.relative_to(PACKAGE)}:{line}: {sentence}"
        for path in sorted((PACKAGE / folder).rglob("*.py"))
        for line, text in texts(ast.parse(path.read_text("utf-8")))
        for sentence in HEADING.split(text)
        if len(sentence.split()) > WORDS
    ]
    assert not found, "\n".join(found)
