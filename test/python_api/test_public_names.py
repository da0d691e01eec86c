"""What the package exports: documented, typed, light to import, and at work without ROS."""

import ast
import doctest
import inspect
import subprocess
import sys
from pathlib import Path

import pytest

import afm_scan_ros as afm

ROOT = Path(__file__).parents[2]
CALLABLES = sorted(name for name in afm.__all__ if not name.startswith("_"))


@pytest.mark.parametrize("name", CALLABLES)
def test_every_public_name_is_documented(name: str) -> None:
    offered = getattr(afm, name)
    message = inspect.getdoc(offered)
    assert message
    for other, member in inspect.getmembers(offered):
        if not other.startswith("_") and inspect.isfunction(member):
            assert inspect.getdoc(member), f"{name}.{other}"


RUNS = [name for name in CALLABLES if ">>>" in (inspect.getdoc(getattr(afm, name)) or "")]


def test_every_class_and_function_of_the_api_has_an_example() -> None:
    made = {"Diagnosis", "ImageIdentification", "Learned"}  # by functions that have an example
    described = {"DriveLimits", "InputError", "ScanError", "ScanImage", "ScanSpec", "read_image"}
    assert set(CALLABLES) - made - described <= set(RUNS)


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=[pytest.mark.evidence] * (name == "identify_from_images"))
        for name in RUNS
    ],
)
def test_the_example_runs(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (example,) = doctest.DocTestFinder(recurse=False).find(getattr(afm, name), name)
    message: list[str] = []
    result = doctest.DocTestRunner().run(example, out=message.append)
    assert result.attempted > 0
    assert result.failed == 0, "".join(message)


def test_no_other_name_is_offered() -> None:
    assert dir(afm) == afm.__all__
    with pytest.raises(AttributeError, match="no attribute 'diagnosis_of'"):
        afm.diagnosis_of  # noqa: B018 - it is the access that raises


def test_the_package_is_typed() -> None:
    assert (ROOT / "afm_scan_ros/py.typed").is_file()
    assert "py.typed" in (ROOT / "pyproject.toml").read_text("utf-8")


def loaded_by(code: str) -> set[str]:
    """Modules that are loaded once some code has run in a fresh interpreter without ROS and DDS."""
    block = "import sys; sys.modules['rclpy'] = sys.modules['cyclonedds'] = None\n"
    command = [sys.executable, "-c", f"{block}{code}\nprint(*sys.modules)"]
    done = subprocess.run(command, capture_output=True, text=True, check=True, cwd=ROOT)
    return set(done.stdout.split())


def test_the_import_alone_loads_nothing() -> None:
    assert not loaded_by("import afm_scan_ros") & {"numpy", "attrs", "numba", "scipy"}


def test_an_inversion_loads_no_more_than_it_takes() -> None:
    """Each of these takes as long as all that is needed."""
    code = (
        "import afm_scan_ros as afm, numpy\nafm.load_model().invert(numpy.zeros((1000, 2)), 1e-4)"
    )
    loaded = loaded_by(code)
    assert {"numba", "numpy"} <= loaded
    assert not loaded & {"scipy.signal", "scipy.optimize", "matplotlib", "bokeh", "mcap", "rosbags"}


@pytest.mark.evidence
def test_ten_lines_lead_from_arrays_to_a_diagnosis(tmp_path: Path) -> None:
    examples = ROOT / "examples"
    script = examples / "ten_lines.py"
    source = script.read_text("utf-8")
    lines = ast.parse(source[source.index("# The ten lines:") :]).body
    assert len(lines) <= 10
    arrays = str(tmp_path / "arrays.npz")
    subprocess.run([sys.executable, examples / "simulated_arrays.py", arrays], check=True, cwd=ROOT)
    words = [sys.executable, script, arrays]
    done = subprocess.run(words, capture_output=True, text=True, check=False, cwd=ROOT)
    assert done.stdout == "effect_found drift\n", done.stderr
