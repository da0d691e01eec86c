"""What a model knows of its uncertainty is saved with it, and is no part of it."""

from pathlib import Path

import numpy as np
import pytest
from attrs import evolve

import afm_scan_ros as afm
from afm_scan_ros.core.effects.hysteresis.duhem import DuhemSlopes
from afm_scan_ros.core.effects.hysteresis.everett import EverettSurface
from afm_scan_ros.core.effects.hysteresis.preisach import OutputMap
from afm_scan_ros.core.effects.sensor import SensorModel
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.model import (
    AxisModel,
    CreepModel,
    HysteresisModel,
    ScannerModel,
    VibrationModel,
)
from afm_scan_ros.core.spread import Spread, Variant
from afm_scan_ros.files import yaml
from afm_scan_ros.files.arrays import load_sealed
from afm_scan_ros.files.model_file import load_model, model_hash, save_model

PERIOD = 1e-3


def surface(slope: float) -> EverettSurface:
    levels = np.linspace(-4.0, 4.0, 9)
    values = np.tril(slope * (levels[:, None] - levels[None, :]))
    return EverettSurface(-4.0, 4.0, values, -8.0 * slope, 0.01)


def slopes(slope: float) -> DuhemSlopes:
    flat = np.full((6, 7), slope)
    return DuhemSlopes(-4.0, 4.0, -4.0, 0.0, (-0.5, 0.6), np.ones(6), flat + 0.1, flat)


def variant(part: float, deviations: float, *, duhem: bool) -> Variant:
    mapped = None if duhem else OutputMap(-4.0, 4.0, (0.01 + part, 0.002))
    return Variant(
        slopes(0.8 + part) if duhem else surface(0.5 + part),
        mapped,
        VibrationModel((8e-6 * 2850.0**2 * (1.0 + part),), (1.0, 60.0, 2850.0**2)),
        CreepModel((0.1 + part, -0.05), (2.0, 70.0)),
        SensorModel(2, 300.0 * (1.0 + part), 2e-3 * (1.0 + part)),
        deviations,
    )


def model(*, duhem: bool) -> ScannerModel:
    one = variant(0.0, 0.0, duhem=duhem)
    apart = [variant(part, size, duhem=duhem) for part, size in ((0.01, 1.0), (0.003, 0.25))]
    spread = Spread(one, tuple(apart), (0.0, 20.0, 500.0), (1e-3, 5e-3))
    hysteresis = HysteresisModel(one.forward, surface(0.5), one.output)
    axis = AxisModel(hysteresis, one.vibration, one.creep, sensor=one.sensor, spread=spread)
    return ScannerModel(y=axis)


DRIVE = 3.0 * np.sin(np.linspace(0.0, 9.0, 500))


@pytest.mark.parametrize("duhem", [False, True])
def test_a_loaded_model_is_as_uncertain(tmp_path: Path, *, duhem: bool) -> None:
    given, path = model(duhem=duhem), tmp_path / "model.yaml"
    save_model(path, given, "a model")
    loaded = afm.load_model(path)
    before = afm.Model(given, "made").predict(DRIVE, PERIOD, return_std=True)
    after = loaded.predict(DRIVE, PERIOD, return_std=True)
    np.testing.assert_allclose(after, before, rtol=1e-12, atol=1e-18)
    assert np.ptp(after[1]) > 0.1 * after[1].max()


def test_where_rest_is_unknown_an_offset_adds_no_uncertainty(tmp_path: Path) -> None:
    one = variant(0.0, 0.0, duhem=False)
    offset = evolve(one, deviations=1.0, forward=evolve(one.forward, offset=one.forward.offset + 1))
    axis = model(duhem=False).axis("y")
    stated = []
    for rest_known in (True, False):
        spread = Spread(one, (offset,), (0.0, 500.0), (0.0,), rest_known=rest_known)
        save_model(tmp_path / "model.yaml", ScannerModel(y=evolve(axis, spread=spread)), "a model")
        loaded = afm.load_model(tmp_path / "model.yaml")
        stated.append(loaded.predict(DRIVE, PERIOD, return_std=True)[1][100:])
    assert stated[0].min() > 1e-6
    assert stated[1].max() < 0.3 * stated[0].min()


def test_how_uncertain_a_model_is_does_not_tell_it_from_another() -> None:
    given = model(duhem=False)
    silent = ScannerModel(y=evolve(given.axis("y"), spread=None))
    assert silent == given
    assert hash(silent) == hash(given)
    assert model_hash(silent) == model_hash(given)


def test_directions_of_another_model_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "model.yaml"
    save_model(path, model(duhem=False), "a model")
    content = load_sealed(path)
    content["y"]["spread"]["directions"] = "y_direct"
    yaml.save(path, content, "a model")
    with pytest.raises(InputError, match=r"y: spread: 'y_direct' holds 9 numbers a direction"):
        load_model(path)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"bands": (0.0, 0.0, 500.0)}, "bands must ascend"),
        ({"shares": (1e-3,)}, "give one share fewer, not 1"),
        ({"shares": (1e-3, -1.0)}, "no share"),
        ({"directions": (variant(0.01, 0.0, duhem=False),)}, "more than 0 deviations"),
    ],
)
def test_what_is_no_spread_is_refused(change: dict[str, object], reason: str) -> None:
    spread = model(duhem=False).axis("y").spread
    with pytest.raises(InputError, match=reason):
        evolve(spread, **change)
