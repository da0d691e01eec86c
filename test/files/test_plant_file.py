"""The plant file: the default one, and what is refused of others."""

from pathlib import Path

import pytest
from attrs import evolve

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.files.plant_file import load_plant
from afm_scan_ros.simulation.mechanisms import PLUGINS
from afm_scan_ros.simulation.mechanisms.base import Mechanism
from afm_scan_ros.simulation.mechanisms.electronics import DelayedConverter, TiltedSensor

DEFAULT = Path(__file__).parents[2] / "config/plant.yaml"


def test_the_default_plant_is_in_si_units_and_the_papers() -> None:
    plant = load_plant(DEFAULT)
    assert plant.sensor.noise_rms == pytest.approx(2e-9)
    assert plant.sensor.quantum == pytest.approx(100e-6 / 65536)
    assert plant.x.vibration.denominator == (1.0, 8980.0, 2.78e7, 7.38e10, 1.55e14)
    assert plant.y.creep.numerator == (1.0, 0.589, 0.0233, 1.48e-5)


@pytest.mark.parametrize(
    ("given", "wrong", "message"),
    [
        ("noise_rms_nm: 2.0", "noise_rms_um: 2.0", "sensor: unknown key 'noise_rms_um'; did you"),
        ("  bits: 16\n", "", "sensor: key 'bits' is missing"),
        ("elements: 80", "elements: 4000000000", "x: hysteresis: elements = 4000000000 is out of"),
        ("bits: 16", "bits: 16.0", "bits = 16.0 should be a whole number"),
        ("decay_v: 1.0", "decay_v: -1.0", "x: hysteresis: decay_v = -1.0 is out of range"),
        ("gain: 0.63978", "gain: .nan", "x: hysteresis: gain = nan is not finite"),
        ("damping: 0.004", "damping: 0.0", r"x: modes\[0\]: damping = 0.0 is out of range"),
        ("[1.0, 8980.0,", "[1.0, -8980.0,", "x: vibration: denominator has the unstable root"),
        ("[0.435,", "[0.1, 0.435,", "x: vibration: numerator must be of lower order"),
        ("[1.0, 0.516, 0.0171, 4.69e-5]", "[1.0, 2.0, 1.0]", "x: creep: numerator must have"),
        ("numerator: [1.0, 0.630, 0.0216, 6.25e-5]", "numerator: 1.0", "should be a list"),
        (
            "denominator: [1.0, 0.516, 0.0171, 4.69e-5]",
            "denominator: [1.0, 3.0, 3.0, 1.0]",
            "x: creep: denominator has a root twice",
        ),
        ("[1.0, 0.516,", "[0.0, 0.516,", "x: creep: denominator must begin with a coefficient"),
        ("[1.0, 0.516,", "[1.0, 1e5,", "x: creep has a root of 100000/s, as fast"),
        ("ramp_down_slew_v_per_s: 40.0", "ramp_down_slew_v_per_s: 3e5", "exceeds slew_limit"),
    ],
)
def test_a_wrong_plant_file_is_refused_with_the_place(
    tmp_path: Path, given: str, wrong: str, message: str
) -> None:
    text = DEFAULT.read_text("utf-8")
    assert given in text
    path = tmp_path / "plant.yaml"
    path.write_text(text.replace(given, wrong, 1), "utf-8")
    with pytest.raises(InputError, match=rf"plant\.yaml.*{message}") as refusal:
        load_plant(path)
    assert "\n" not in str(refusal.value)


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"none\.yaml: no such file"):
        load_plant(tmp_path / "none.yaml")


def test_mechanisms_are_added_to_those_of_the_base(tmp_path: Path) -> None:
    first, second = tmp_path / "first.yaml", tmp_path / "second.yaml"
    delay = "{kind: delayed_converter, axis: x, delay_us: 17.0}"
    tilt = "{kind: tilted_sensor, axis: 'y', angle_mrad: 3.0}"
    first.write_text(DEFAULT.read_text("utf-8") + f"\nmechanisms: [{delay}]\n", "utf-8")
    second.write_text(f"base: first.yaml\nmechanisms: [{tilt}]\n", "utf-8")
    plant = load_plant(second)
    assert evolve(plant, mechanisms=()) == load_plant(DEFAULT)
    assert plant.mechanisms == (
        DelayedConverter(axis="x", delay=17e-6),
        TiltedSensor(axis="y", angle=3e-3),
    )


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("base: none.yaml", r"none\.yaml: no such file"),
        ("base: 1", "base = 1 should be the path of a plant file"),
        ("base: BASE\nbits: 16", "unknown key 'bits'"),
        ("base: BASE\nmechanisms: 1", "mechanisms should be a list"),
        ("base: BASE\nmechanisms: [1]", r"mechanisms\[0\]: key 'kind' is missing"),
        ("base: BASE\nmechanisms: [{axis: x}]", "key 'kind' is missing"),
        (
            "base: BASE\nmechanisms: [{kind: tilt_sensor, axis: x}]",
            r"mechanisms\[0\]: unknown kind 'tilt_sensor': give one of .*, tilted_sensor,",
        ),
        ("base: BASE\nmechanisms: [{kind: [1], axis: x}]", r"unknown kind \[1\]: give one of "),
        ("base: BASE\nmechanisms: [{kind: tilted_sensor, axis: y}]", "put it in quotes, as 'y'"),
        (
            "base: BASE\nmechanisms: [{kind: tilted_sensor, axis: z, angle_mrad: 1.0}]",
            r"mechanisms\[0\]: axis = z is out of range",
        ),
        (
            "base: BASE\nmechanisms: [{kind: tilted_sensor, axis: x, angle_mrad: 1e3}]",
            r"mechanisms\[0\]: angle_mrad = 1000.0 is out of range",
        ),
    ],
)
def test_wrong_mechanisms_are_refused_with_the_place(
    tmp_path: Path, content: str, message: str
) -> None:
    path = tmp_path / "plant.yaml"
    path.write_text(content.replace("BASE", str(DEFAULT)), "utf-8")
    with pytest.raises(InputError, match=message) as refusal:
        load_plant(path)
    assert "\n" not in str(refusal.value)


def test_plants_that_lead_to_each_other_are_refused(tmp_path: Path) -> None:
    for name, base in (("a", "a"), ("b", "c"), ("c", "b")):
        (tmp_path / f"{name}.yaml").write_text(f"base: {base}.yaml", "utf-8")
    for name in "ab":
        with pytest.raises(InputError, match="refers back to the file itself"):
            load_plant(tmp_path / f"{name}.yaml")


def test_a_kind_that_the_product_lacks_is_looked_for_in_other_packages(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    package = tmp_path / "their_mechanisms"
    (tmp_path / "theirs-1.0.dist-info").mkdir()
    (tmp_path / "theirs-1.0.dist-info/METADATA").write_text("Name: theirs\nVersion: 1.0\n", "utf-8")
    (tmp_path / "theirs-1.0.dist-info/entry_points.txt").write_text(
        f"[{PLUGINS}]\ntheirs = {package.name}\n", "utf-8"
    )
    package.with_suffix(".py").write_text(
        """
from typing import ClassVar
from attrs import frozen
from afm_scan_ros.simulation.mechanisms.base import Alteration

@frozen(kw_only=True)
class Theirs(Alteration):
    KIND: ClassVar[str] = "theirs"

    def altered(self, axis):
        return axis
""",
        "utf-8",
    )
    monkeypatch.syspath_prepend(tmp_path)
    path = tmp_path / "plant.yaml"
    path.write_text(f"base: {DEFAULT}\nmechanisms: [{{kind: theirs, axis: x}}]\n", "utf-8")
    try:
        assert [each.KIND for each in load_plant(path).mechanisms] == ["theirs"]
    finally:
        Mechanism.KINDS.pop("theirs", None)
