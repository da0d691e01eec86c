"""A model file that was cut short is refused, also where what is left of it is a model."""

from pathlib import Path

import numpy as np
import pytest
from attrs import evolve
from hypothesis import given
from hypothesis import strategies as st

import afm_scan_ros as afm
from afm_scan_ros.core.coupled_scanner import CoupledScanner, LevelError
from afm_scan_ros.core.effects.effect_type import Actuators
from afm_scan_ros.core.identification.state_space.model import StateSpaceModel
from afm_scan_ros.core.model import Added, ScannerModel
from afm_scan_ros.files import share_directory, yaml
from afm_scan_ros.files.arrays import SEAL


def given_model() -> afm.Model:
    """The model that the package brings: errors on further records end its axes."""
    return afm.load_model()


def of_one_axis() -> afm.Model:
    return afm.Model(ScannerModel(afm.load_model().scanner.x), "")


def extended() -> afm.Model:
    scanner = afm.load_model().scanner
    x = evolve(scanner.x, effects=scanner.x.effects, added=(Added("delay", "", (2e-5,)),))
    return afm.Model(evolve(scanner, x=x), "")


def coupled() -> afm.Model:
    two = np.eye(2)
    structure = StateSpaceModel(0.5 * two, two, 1e-6 * two, 0.0 * two, 1e-4)
    actuators = Actuators(np.ones(2), two, 0.1, 1e-4)
    errors = (LevelError(0.1, 1e-9, 1e-7, (0.01, 0.02)), LevelError(0.2, 2e-9, 2e-7, (0.02,)))
    scanner = CoupledScanner(("x", "y"), structure, (1.0, 1e3), (), actuators, 1.0, errors)
    return afm.Model(scanner, "")


MODELS = {make.__name__: make for make in (given_model, of_one_axis, extended, coupled)}


@pytest.fixture(scope="module", params=MODELS)
def saved(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("saved") / "model.yaml"
    MODELS[request.param]().save(path)
    return path


def is_refused(saved: Path, left: bytes) -> bool:
    """Whether what is left of a file is refused by its name; else nothing of it is lost."""
    cut = saved.with_name("cut.yaml")
    cut.write_bytes(left)
    try:
        afm.load_model(cut)
    except afm.InputError as error:
        return str(error).startswith(f"{cut}: ")
    assert yaml.load(cut) == yaml.load(saved)
    return False


def test_a_file_without_its_last_lines_is_no_model(saved: Path) -> None:
    lines = saved.read_bytes().splitlines(keepends=True)
    assert all(is_refused(saved, b"".join(lines[:kept])) for kept in range(len(lines)))
    assert not is_refused(saved, b"".join(lines))


@given(st.data())
def test_a_file_that_ends_anywhere_is_no_other_model(saved: Path, data: st.DataObject) -> None:
    content = saved.read_bytes().rstrip()
    kept = data.draw(st.integers(0, len(content) - 1), "bytes kept")
    assert is_refused(saved, content[:kept])


@given(st.data())
def test_a_file_that_lacks_lines_within_is_no_other_model(saved: Path, data: st.DataObject) -> None:
    lines = saved.read_bytes().splitlines(keepends=True)
    first = data.draw(st.integers(2, len(lines) - 1), "first line that lacks")  # below the digest
    last = data.draw(st.integers(first, len(lines) - 1), "last line that lacks")
    assert is_refused(saved, b"".join(lines[:first] + lines[last + 1 :]))


def test_the_model_that_the_package_brings_states_its_digest() -> None:
    assert SEAL in yaml.load(share_directory() / "config/model.yaml")
