"""The plant file: the default one, and what is refused of others."""

from pathlib import Path

import pytest

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.files.plant_file import load_plant

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
