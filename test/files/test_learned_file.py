"""A learned correction survives its file, and no damaged or foreign one is used."""

from pathlib import Path

import numpy as np
import pytest
from attrs import evolve
from hypothesis import given
from hypothesis import strategies as st

from afm_scan_ros.core.correction import Correction
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.trajectory import total_samples
from afm_scan_ros.files.drive_files import load_learned, save_learned
from helpers.in_process import default_model

SPEC = ScanSpec(line_rate=30.1, lines=2, samples_per_line=200, preparation="none")


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A correction of random values."""
    path = tmp_path_factory.mktemp("learned") / "learned.npz"
    rng = np.random.default_rng(0)
    save_learned(
        path, Correction(SPEC, *rng.standard_normal((2, total_samples(SPEC)))), default_model()
    )
    return path


def test_it_comes_back_as_it_was(file: Path) -> None:
    learned = load_learned(file)
    x, y = np.random.default_rng(0).standard_normal((2, total_samples(SPEC)))
    assert learned.correction.spec == SPEC
    np.testing.assert_array_equal(learned.correction.x, x)
    np.testing.assert_array_equal(learned.correction.y, y)
    learned.refuse_other(SPEC, default_model())


@pytest.mark.parametrize(
    ("name", "value"), [("line_rate", 31.0), ("range_x", 41e-6), ("pattern", "sinusoidal")]
)
def test_another_scan_is_refused_by_the_name_of_what_differs(
    file: Path, name: str, value: object
) -> None:
    with pytest.raises(InputError, match=f"was learned at {name} = "):
        load_learned(file).refuse_other(evolve(SPEC, **{name: value}), default_model())


def test_another_model_is_refused(file: Path) -> None:
    model = default_model()
    other = evolve(model, x=evolve(model.x, creep=model.y.creep))
    with pytest.raises(InputError, match="was learned with another model"):
        load_learned(file).refuse_other(SPEC, other)


@given(st.integers(0, 4000), st.integers(1, 255))
def test_a_damaged_file_is_no_correction(file: Path, place: int, change: int) -> None:
    """Whatever byte is wrong, the file is refused or read as it was."""
    content = bytearray(file.read_bytes())
    content[place % len(content)] ^= change
    damaged = file.with_name("damaged.npz")
    damaged.write_bytes(content)
    try:
        learned = load_learned(damaged)
    except InputError as error:
        assert str(damaged) in str(error)  # noqa: PT017 - most bytes are noticed, but not all count
    else:
        x, _ = np.random.default_rng(0).standard_normal((2, total_samples(SPEC)))
        np.testing.assert_array_equal(learned.correction.x, x)


def test_a_file_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such file: give one that 'afm-scan learn' wrote"):
        load_learned(tmp_path / "none.npz")
