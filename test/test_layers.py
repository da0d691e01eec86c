"""Who may import whom."""

import ast
import re
import subprocess
import sys
from collections import Counter
from collections.abc import Container
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[1] / "afm_scan_ros"
CORE_MODULES = [
    "afm_scan_ros." + ".".join(path.relative_to(PACKAGE).with_suffix("").parts)
    for path in sorted((PACKAGE / "core").rglob("*.py"))
]

PUBLIC = ("diagnosis", "identification", "model")  # modules of the public functions
ABOVE = (*PUBLIC, "cli", "pipeline", "report")  # what stands on all the others
# Folder: what nothing in it imports.
NEVER = {
    "core": (*ABOVE, "bag", "drivers", "features", "files", "nodes", "simulation"),
    "simulation": (*ABOVE, "bag", "drivers", "features", "files", "nodes"),
    "files": (*ABOVE, "bag", "drivers", "features", "nodes"),
    "bag": (*ABOVE, "drivers", "features", "nodes", "simulation"),
    "drivers": (*ABOVE, "bag", "nodes"),
    "nodes": ABOVE,
    "report": (*PUBLIC, "cli", "features", "pipeline"),
    **dict.fromkeys(PUBLIC, ("cli", "features", "nodes", "pipeline", "simulation")),
}
FEATURES = sorted(
    path.name for path in (PACKAGE / "features").iterdir() if path.is_dir() and path.name[0] != "_"
)
SIMULATION_MAY = {"types", "errors", "compiled", "limits"}


def modules_imported(path: Path) -> set[str]:
    """Full names of the modules that a file imports, and of the names taken from them."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text("utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            found |= {f"{node.module}.{alias.name}" for alias in node.names}
    return found


def imports_of(folder: Path) -> dict[Path, set[str]]:
    paths = folder.rglob("*.py") if folder.is_dir() else [folder.with_suffix(".py")]
    return {path: modules_imported(path) for path in paths}


@pytest.mark.parametrize("folder", NEVER)
def test_the_data_goes_one_way(folder: str) -> None:
    for path, names in imports_of(PACKAGE / folder).items():
        for other in NEVER[folder]:
            back = [name for name in names if f"{name}.".startswith(f"afm_scan_ros.{other}.")]
            assert not back, f"{path.relative_to(PACKAGE)} imports {back}"


def test_the_kernel_imports_no_feature() -> None:
    """It finds them by their registry; the package's own names may be a feature's."""
    for path, names in imports_of(PACKAGE).items():
        if path.relative_to(PACKAGE).parts[0] not in ("__init__.py", "features"):
            assert not [n for n in names if n.startswith("afm_scan_ros.features.")], path


@pytest.mark.parametrize("feature", FEATURES)
def test_no_feature_imports_another(feature: str) -> None:
    for path, names in imports_of(PACKAGE / "features" / feature).items():
        found = {name.split(".")[2] for name in names if name.startswith("afm_scan_ros.features.")}
        assert found <= {feature}, path


def test_the_plant_shares_no_physics_with_the_model() -> None:
    for path, names in imports_of(PACKAGE / "simulation").items():
        core = {name.split(".")[2] for name in names if name.startswith("afm_scan_ros.core.")}
        assert core <= SIMULATION_MAY, path.name


NEED_ROS = {"cli/by_nodes.py", "cli/listening.py", "features/view/listening.py"}
"""Modules beside the nodes that are imported only where ROS is."""


def test_only_nodes_and_what_listens_to_them_name_the_middleware() -> None:
    for path, names in imports_of(PACKAGE).items():
        place = path.relative_to(PACKAGE)
        inside = place.parts[0] == "nodes" or place.as_posix() in NEED_ROS
        assert inside or not [name for name in names if name.split(".")[0] == "rclpy"], place


@pytest.mark.parametrize("folder", [PACKAGE, PACKAGE.parent / "test"], ids=lambda path: path.name)
def test_the_product_and_its_tests_know_no_benchmark(folder: Path) -> None:
    for path, names in imports_of(folder).items():
        assert not [n for n in names if n.startswith("afm_scan_bench")], path


def test_no_modules_import_each_other() -> None:
    """Wherever an import stands: in a function or for the type checker alone, too."""
    known = {module_name(path): names for path, names in imports_of(PACKAGE).items()}
    graph = {
        module: {found for name in names if (found := module_of(name, known)) not in ("", module)}
        for module, names in known.items()
    }
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        pytest.fail(" -> ".join(error.args[1]))


def module_name(path: Path) -> str:
    parts = path.relative_to(PACKAGE.parent).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def module_of(name: str, known: Container[str]) -> str:
    """The module that an import of ``name`` runs: itself, or that of which it is a part."""
    return name if name in known else next((n for n in [name.rpartition(".")[0]] if n in known), "")


def test_core_and_the_commands_need_no_middleware() -> None:
    commands = [p for p in (PACKAGE / "cli").glob("*.py") if f"cli/{p.name}" not in NEED_ROS]
    names = [*CORE_MODULES, "afm_scan_ros.pipeline", *(module_name(path) for path in commands)]
    hidden = "sys.modules['rclpy'] = sys.modules['afm_scan_ros.msg'] = None"
    block = f"import sys, importlib\n{hidden}\n"
    code = block + f"for name in {names!r}: importlib.import_module(name)"
    subprocess.run([sys.executable, "-c", code], check=True, cwd=PACKAGE.parent)


def test_one_class_has_one_name() -> None:
    names = Counter(
        node.name
        for path in PACKAGE.rglob("*.py")
        for node in ast.walk(ast.parse(path.read_text("utf-8")))
        if isinstance(node, ast.ClassDef)
    )
    assert [name for name, count in names.items() if count > 1] == []


def test_the_page_on_the_architecture_names_places_that_exist() -> None:
    page = (PACKAGE.parent / "docs" / "architecture.md").read_text("utf-8")
    named = set(re.findall(r"\b(?<!_)[a-z][a-z_/]+(?:\.py|/)(?=[`,)\s])", page)) - {"features/"}
    missing = [
        name
        for name in named
        if not any((folder / name).exists() for folder in (PACKAGE, PACKAGE.parent))
        and not list(PACKAGE.rglob(name))
    ]
    assert missing == []
