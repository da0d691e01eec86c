"""What pip, colcon and ROS read agrees with the package."""

import ast
import re
import runpy
import sys
import tomllib
from importlib.util import find_spec
from itertools import chain
from pathlib import Path
from unittest.mock import patch
from xml.etree import ElementTree as ET

import pytest
import setuptools

import afm_scan_ros
from afm_scan_ros.files import version

ROOT = Path(__file__).parents[1]
PACKAGE = ET.parse(ROOT / "package.xml").getroot()  # noqa: S314 - our own file
EXECUTABLES = (ROOT / "resource/executables.txt").read_text("utf-8").splitlines()

# Names in rosdep of what pip calls otherwise; mcap alone has no key and comes with the last one,
# as lz4 and zstandard come with mcap.
ROSDEP = {
    "attrs": "python3-attrs",
    "bokeh": "python3-bokeh-pip",
    "click": "python3-click",
    "jinja2": "python3-jinja2",
    "matplotlib": "python3-matplotlib",
    "mcap": "mcap-ros2-support",
    "numba": "python3-numba",
    "numpy": "python3-numpy",
    "pyyaml": "python3-yaml",
    "rich": "python3-rich",
    "rosbags": "python3-rosbags-pip",
    "scipy": "python3-scipy",
}


PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]


def test_one_version() -> None:
    with patch.object(setuptools, "setup") as setup:
        runpy.run_path(str(ROOT / "setup.py"))
    assert setup.call_args.kwargs["version"] == version() == PACKAGE.findtext("version")
    assert afm_scan_ros.__version__ == version()
    assert re.fullmatch(r"\d+\.\d+\.\d+", version())


@pytest.mark.parametrize("line", EXECUTABLES)
def test_every_executable_has_its_function(line: str) -> None:
    found = re.fullmatch(r"([a-z_-]+) = ([a-z_.]+):([a-z_]+)", line)  # as CMakeLists.txt reads it
    assert found is not None
    module = find_spec(found[2])
    assert module is not None
    assert module.origin is not None
    body = ast.parse(Path(module.origin).read_text("utf-8")).body
    assert found[3] in [part.name for part in body if isinstance(part, ast.FunctionDef)]


def test_a_switch_of_the_launch_file_takes_no_other_word() -> None:
    """Else ``watch:=True`` would leave out the monitor, silently."""
    tree = ast.parse((ROOT / "launch/scan.launch.py").read_text("utf-8"))
    calls = [node for node in ast.walk(tree) if isinstance(node, ast.Call)]
    (watch,) = (call for call in calls if [ast.unparse(a) for a in call.args] == ["'watch'"])
    given = {word.arg: ast.literal_eval(word.value) for word in watch.keywords}
    assert (given["default_value"], given["choices"]) == ("true", ["true", "false"])


def test_ros_is_told_of_every_dependency() -> None:
    names = {re.match(r"[a-z0-9]+", requirement)[0] for requirement in PROJECT["dependencies"]}
    assert names == set(ROSDEP)
    for_ros = {each.text for each in PACKAGE.iter("exec_depend")}
    assert set(ROSDEP.values()) <= for_ros


def test_the_documents_say_why_of_every_dependency() -> None:
    text = (ROOT / "docs/dependencies.md").read_text("utf-8")
    extras = PROJECT["optional-dependencies"].values()
    for requirement in chain(PROJECT["dependencies"], *extras):
        name = re.match(r"[A-Za-z0-9-]+", requirement)[0]
        assert f"| {name} |" in text


def test_every_import_is_declared() -> None:
    extras = {"distributed", "nidaqmx", "pyarrow", "rerun"}
    extras |= {"NSFopen", "gsffile", "gwyfile", "h5netcdf", "igor2", "pySPM"}
    declared = {*ROSDEP, *extras, "yaml", "afm_scan_ros", "lz4", "zstandard", "PIL"}  # matplotlib's
    declared |= {"markupsafe", "IPython"}  # jinja2's, and where there is a notebook
    ros = {each.text for kind in ("depend", "exec_depend") for each in PACKAGE.iter(kind)}
    for path in (ROOT / "afm_scan_ros").rglob("*.py"):
        unknown = imported(path) - declared - ros - sys.stdlib_module_names
        assert not unknown, f"{path.name} imports {unknown}"


def imported(path: Path) -> set[str]:
    """Top-level names of the modules that a file imports."""
    names = []
    for node in ast.walk(ast.parse(path.read_text("utf-8"))):
        if isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            names.append(node.module or "")
    return {name.split(".")[0] for name in names}


def test_generated_messages_are_found_and_never_overwritten() -> None:
    assert not (ROOT / "afm_scan_ros/msg").exists()
    source = ast.parse((ROOT / "afm_scan_ros/__init__.py").read_text("utf-8"))
    assert any(ast.unparse(part).startswith("__path__ = ") for part in source.body)
    assert str(ROOT / "afm_scan_ros") in list(afm_scan_ros.__path__)
