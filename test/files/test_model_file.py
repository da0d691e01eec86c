"""A model is saved and loaded, and a file that is not one is refused."""

import re
import shutil
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from attrs import evolve

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.model import (
    AxisModel,
    BaseEffects,
    CreepModel,
    DuhemSlopes,
    EffectStatus,
    EverettSurface,
    HysteresisModel,
    ModelDiscrepancy,
    OutputMap,
    ParameterInterval,
    ScannerModel,
    VibrationModel,
)
from afm_scan_ros.files import yaml
from afm_scan_ros.files.arrays import SEAL, load_sealed
from afm_scan_ros.files.model_file import load_model, model_hash, save_model


def surface(slope: float) -> EverettSurface:
    levels = np.linspace(-4.0, 4.0, 9)
    values = np.tril(slope * (levels[:, None] - levels[None, :]))
    return EverettSurface(-4.0, 4.0, values, -5.0)


def axis(slope: float) -> AxisModel:
    return AxisModel(
        HysteresisModel(surface(slope), surface(1.0 / slope)),
        VibrationModel((8e-6 * 2850.0**2,), (1.0, 60.0, 2850.0**2)),
        CreepModel((0.1, 0.05), (2.0, 70.0)),
    )


MODEL = ScannerModel(axis(0.5), axis(0.75))
KNOWN = ModelDiscrepancy("a record", (0.0, 1.0, 25.0), (9e-9, 2e-9), (1e-10, 3e-10), (5e-6, 1e-6))


def test_uneven_levels_come_back_and_even_ones_are_not_written(tmp_path: Path) -> None:
    levels = np.array([-4.0, -2.0, -1.0, -0.5, 0.0, 0.5, 1.0, 2.0, 4.0])
    values = np.tril(levels[:, None] - levels)
    uneven = EverettSurface(-4.0, 4.0, values, -5.0, uneven=levels)
    x = evolve(MODEL.x, hysteresis=evolve(MODEL.x.hysteresis, forward=uneven))
    model = ScannerModel(x, MODEL.y)
    save_model(tmp_path / "model.yaml", model, "a model")
    loaded = load_model(tmp_path / "model.yaml")
    assert loaded.x.hysteresis == x.hysteresis
    assert model_hash(loaded) == model_hash(model) != model_hash(MODEL)
    written = yaml.load(tmp_path / "model.yaml")
    assert "uneven_levels" in written["x"]["hysteresis"]["forward"]
    assert "uneven_levels" not in written["y"]["hysteresis"]["forward"]


@pytest.fixture
def saved(tmp_path: Path) -> Path:
    path = tmp_path / "model.yaml"
    save_model(path, MODEL, "a model")
    return path


def test_a_model_comes_back(saved: Path) -> None:
    model = load_model(saved)
    assert np.array_equal(model.y.hysteresis.direct.values, surface(4 / 3).values)
    assert model.x.hysteresis.forward.offset == -5.0
    assert model.x.vibration.numerator == pytest.approx(MODEL.x.vibration.numerator, rel=1e-15)
    assert model.x.creep == MODEL.x.creep
    in_file = yaml.load(saved)["x"]["vibration"]["numerator_v_per_v"]
    assert in_file == pytest.approx([2850.0**2], rel=1e-15)


def slopes(slope: float) -> DuhemSlopes:
    flat = np.full((6, 7), slope)
    steeper = flat + 0.01 * np.arange(7)
    return DuhemSlopes(-4.0, 4.0, -2.0, 0.1, (-0.5, 0.6), flat[:, 0], steeper, flat)


def test_a_duhem_operator_comes_back(tmp_path: Path) -> None:
    hysteresis = HysteresisModel(slopes(0.5), surface(2.0))
    path = tmp_path / "duhem.yaml"
    save_model(path, evolve(MODEL, x=evolve(MODEL.x, hysteresis=hysteresis)), "a model")
    assert load_model(path).x.hysteresis == hysteresis
    others = (slopes(0.6), evolve(slopes(0.5), rest=0.2), surface(0.5))
    models = [HysteresisModel(each, surface(2.0)) for each in (slopes(0.5), *others)]
    hashes = {model_hash(evolve(MODEL, x=evolve(MODEL.x, hysteresis=each))) for each in models}
    assert len(hashes) == len(models)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"upper_v": -5.0}, "x: hysteresis: duhem: a Duhem operator's range must grow"),
        ({"values": "x_nothing"}, "x: hysteresis: duhem: .*no array 'x_nothing'"),
        ({"widths_v": [1.0]}, "widths_v has 1 entries"),
    ],
)
def test_a_duhem_operator_that_is_none_is_refused(
    tmp_path: Path, change: dict[str, object], message: str
) -> None:
    path = tmp_path / "duhem.yaml"
    hysteresis = HysteresisModel(slopes(0.5), surface(2.0))
    save_model(path, evolve(MODEL, x=evolve(MODEL.x, hysteresis=hysteresis)), "a model")
    content = load_sealed(path)
    content["x"]["hysteresis"]["duhem"].update(change)
    yaml.save(path, content, "a model")
    with pytest.raises(InputError, match=message):
        load_model(path)


def test_a_hysteresis_with_no_or_two_operators_is_refused(saved: Path) -> None:
    content = load_sealed(saved)
    del content["x"]["hysteresis"]["forward"]
    yaml.save(saved, content, "a model")
    with pytest.raises(InputError, match=r"x: hysteresis: give one operator"):
        load_model(saved)


def test_an_output_map_comes_back(tmp_path: Path) -> None:
    hysteresis = evolve(MODEL.x.hysteresis, output=OutputMap(-2.0, 2.0, (1.0, 0.05)))
    model = evolve(MODEL, x=evolve(MODEL.x, hysteresis=hysteresis))
    save_model(tmp_path / "mapped.yaml", model, "A test's model.")
    found = load_model(tmp_path / "mapped.yaml")
    assert found.x.hysteresis.output == hysteresis.output


def test_the_hash_distinguishes_models_and_not_where_they_lie(saved: Path, tmp_path: Path) -> None:
    moved = tmp_path / "elsewhere"
    shutil.copytree(saved.parent, moved, ignore=lambda *_: ["elsewhere"])
    assert model_hash(load_model(moved / saved.name)) == model_hash(load_model(saved))
    others = (
        evolve(MODEL, x=MODEL.y),
        evolve(MODEL, y=evolve(MODEL.y, creep=CreepModel((0.1, 0.05), (2.0, 70.1)))),
        evolve(MODEL, y=evolve(MODEL.y, creep=CreepModel((), ()))),
    )
    assert len({model_hash(model) for model in (MODEL, *others)}) == 1 + len(others)


def test_the_model_discrepancy_of_an_axis_comes_back_and_leaves_the_hash_alone(
    tmp_path: Path,
) -> None:
    known = evolve(MODEL, x=evolve(MODEL.x, model_discrepancy=KNOWN))
    save_model(tmp_path / "known.yaml", known, "a model")
    model = load_model(tmp_path / "known.yaml")
    assert model.x.model_discrepancy == KNOWN
    assert model.y.model_discrepancy is None
    assert model_hash(known) == model_hash(MODEL)
    in_file = yaml.load(tmp_path / "known.yaml")["x"]["model_discrepancy"]
    assert in_file["rms_nm"] == [9.0, 2.0]


def test_how_effects_are_known_comes_back_and_leaves_the_hash_alone(tmp_path: Path) -> None:
    bound = ParameterInterval("gain_1", "1", lower=0.1)
    effects = BaseEffects(
        creep=EffectStatus("assumed", hold_times=(0.1, 60.0), intervals=(bound,)),
        hysteresis=EffectStatus(drive=(-4.0, 4.0), frequencies=(0.0, 3.0)),
        vibration=EffectStatus("unknown", identifiable_from="frequency"),
    )
    known = evolve(MODEL, x=evolve(MODEL.x, effects=effects))
    save_model(tmp_path / "known.yaml", known, "a model")
    model = load_model(tmp_path / "known.yaml")
    assert model.x.effects == effects
    assert model.y.effects == BaseEffects()
    assert model_hash(known) == model_hash(MODEL)


def test_a_file_that_does_not_say_how_effects_are_known_has_identified_all(saved: Path) -> None:
    content = load_sealed(saved)
    for axis in ("x", "y"):
        del content[axis]["effects"]
    yaml.save(saved, content, "a model")
    assert load_model(saved).x.effects == BaseEffects()


@pytest.mark.parametrize(
    ("old", "new", "reason"),
    [
        ("status: identified", "status: guessed", "out of range"),
        ("status: identified", "status: unknown", "identifiable_from is ''.*give one of"),
        ("intervals: []", "drive_v: [2.0, 1.0]", "smaller end first"),
    ],
)
def test_what_is_no_status_is_refused(saved: Path, old: str, new: str, reason: str) -> None:
    replace(old, new)(saved)
    with pytest.raises(InputError, match=reason) as refusal:
        load_model(saved)
    assert str(saved) in str(refusal.value)


KNOWN_IN_FILE = """
  model_discrepancy:
    record: a record
    bands_hz: [0.0, 1.0]
    rms_nm: [9.0]
    noise_rms_nm: [1.0]
    displacement_rms_nm: [50.0]"""
BAD_KNOWN = [
    ("rms_nm: [9.0]", "rms_nm: [9.0, 1.0]", "x: model_discrepancy has 2 edges"),
    ("rms_nm: [9.0]", "rms: [9.0]", "unknown key 'rms'; did you mean 'rms_nm'"),
    ("[0.0, 1.0]", "[1.0, 0.0]", "must ascend"),
    ("rms_nm: [9.0]", "rms_nm: [-9.0]", "no rms"),
    ("record: a record", "record: 1.0", "model_discrepancy: record = 1.0 should be text"),
    (KNOWN_IN_FILE, "\n  model_discrepancy: 9.0", "model_discrepancy: expected 'key: value' lines"),
]


@pytest.mark.parametrize(("old", "new", "reason"), BAD_KNOWN)
def test_what_is_no_model_discrepancy_is_refused(
    saved: Path, old: str, new: str, reason: str
) -> None:
    creep = "\n    time_constants_s: [2.0, 70.0]"
    replace(creep, creep + KNOWN_IN_FILE)(saved)
    assert load_model(saved).x.model_discrepancy is not None
    replace(old, new)(saved)
    with pytest.raises(InputError, match=reason):
        load_model(saved)


def replace(old: str, new: str) -> Callable[[Path], None]:
    """Edit the file, and delete its digest."""

    def change(path: Path) -> None:
        text = re.sub(f"{SEAL}: .*\n", "", path.read_text(encoding="utf-8"))
        assert old in text
        path.write_text(text.replace(old, new, 1), encoding="utf-8")

    return change


def arrays(**changed: object) -> Callable[[Path], None]:
    def change(path: Path) -> None:
        given = dict(np.load(path.with_suffix(".npz"))) | changed
        np.savez(path.with_suffix(".npz"), **{k: v for k, v in given.items() if v is not None})

    return change


def npz_bytes(cut: Callable[[bytes], bytes]) -> Callable[[Path], None]:
    def change(path: Path) -> None:
        beside = path.with_suffix(".npz")
        beside.write_bytes(cut(beside.read_bytes()))

    return change


def npy_header(shape: str, kind: str) -> bytes:
    """Beginning of an array that states what its file may not hold."""
    words = f"{{'descr': '{kind}', 'fortran_order': False, 'shape': {shape}, }}".ljust(117) + "\n"
    return b"\x93NUMPY\1\0" + len(words).to_bytes(2, "little") + words.encode()


def member(content: bytes, compression: int = zipfile.ZIP_STORED) -> Callable[[Path], None]:
    """Replace x_direct by bytes that may be no array."""

    def change(path: Path) -> None:
        given = dict(np.load(path.with_suffix(".npz")))
        del given["x_direct"]
        np.savez(path.with_suffix(".npz"), **given)
        with zipfile.ZipFile(path.with_suffix(".npz"), "a", compression) as archive:
            archive.writestr("x_direct.npy", content)

    return change


def locked(content: bytes) -> bytes:
    """Say of every array that it is encrypted."""
    return re.sub(rb"(?s)(PK\x01\x02....)\0", rb"\g<1>" + b"\1", content)


def flipped(content: bytes) -> bytes:
    middle = len(content) // 2
    return content[:middle] + bytes([content[middle] ^ 0xFF]) + content[middle + 1 :]


BAD = [
    (replace("numerator_v_per_v", "numerator"), "did you mean 'numerator_v_per_v'"),
    (replace("numerator_v_per_v", "numerator_m_per_v"), "did you mean 'numerator_v_per_v'"),
    (replace("lower_v: -4.0", "lower_v: 4.0"), "forward: .*lower < upper"),
    (replace("8.0e-06", "-8.0e-06"), "sensor_sensitivity_m_per_v = -8e-06 is out of range"),
    (replace("time_constants_s: [2.0", "time_constants_s: [.nan"), "not finite"),
    (replace("time_constants_s: [2.0", "time_constants_s: [-2.0"), "x: .*must be positive"),
    (replace("time_constants_s: [2.0, ", "time_constants_s: ["), "one of each"),
    (replace("[1.0, 60.0", "[1.0, -60.0"), "not damped"),
    (replace("arrays: model.npz", "arrays: ../model.npz"), "arrays = .* is out of range"),
    (replace("arrays: model.npz", "arrays: other.npz"), "other.npz: no such file"),
    (replace("values: x_forward", "values: z"), "no array 'z' among"),
    (arrays(x_direct=None), "no array 'x_direct'"),
    (arrays(x_direct=np.zeros((3, 4))), r"square float64 matrix, not float64 of shape \(3, 4\)"),
    (arrays(x_direct=np.zeros(9)), "square float64 matrix"),
    (arrays(x_direct=np.zeros((9, 9), dtype=np.int64)), "square float64 matrix, not int64"),
    (arrays(x_direct=np.array([[{}]])), "'x_direct' is damaged"),
    (member(b""), "'x_direct' is damaged"),
    (member(npy_header("(9, 9)", "<f8")), "states float64 of shape .9, 9., 648 bytes, where 0"),
    (member(npy_header("(2000000, 1000000)", "<f8")), "16000000000000 bytes, where 0 follow"),
    (member(npy_header("(-9, -9)", "<f8") + bytes(648)), "shape .-9, -9."),
    (member(npy_header("()", "|O")), "holds objects"),
    (member(npy_header("(9, 9", "<f8")), "its header cannot be read"),
    (member(bytes(2**25), zipfile.ZIP_DEFLATED), "'x_direct' has 33554432 bytes"),
    (npz_bytes(locked), "encrypted"),
    (arrays(x_direct=surface(0.3).values), "arrays_sha256 is not that of model.npz"),
    (arrays(x_direct=np.full((9, 9), np.nan)), "x: hysteresis: direct: .*finite"),
    (arrays(x_direct=np.zeros((1500, 1500))), "'x_direct' has .* bytes"),
    (npz_bytes(lambda content: content[: len(content) // 2]), "not an .npz file"),
    (npz_bytes(lambda _: b""), "not an .npz file"),
    (npz_bytes(flipped), "is damaged"),
]


@pytest.mark.parametrize(("change", "reason"), BAD)
def test_what_is_no_model_is_refused(
    saved: Path, change: Callable[[Path], None], reason: str
) -> None:
    change(saved)
    with pytest.raises(InputError, match=reason) as refusal:
        load_model(saved)
    assert str(saved.parent) in str(refusal.value)
    assert "\n" not in str(refusal.value)
