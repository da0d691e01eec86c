"""What the benchmarks use of the product, and how they name their classes."""

import ast
from collections import Counter
from pathlib import Path

import afm_scan_bench

FOLDER = Path(afm_scan_bench.__file__).parent


def test_benchmarks_use_only_public_names_of_the_product() -> None:
    for path in FOLDER.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("afm_scan_ros"):
                names = [*(node.module or "").split("."), *(alias.name for alias in node.names)]
                assert not [name for name in names if name.startswith("_")], f"{path}: {names}"


def test_one_class_of_the_benchmarks_has_one_name() -> None:
    names = Counter(
        node.name
        for path in FOLDER.rglob("*.py")
        for node in ast.walk(ast.parse(path.read_text("utf-8")))
        if isinstance(node, ast.ClassDef)
    )
    assert [name for name, count in names.items() if count > 1] == []
