"""A disturbance's phase is each record's own; all else of an extension is not fitted again."""

import numpy as np
from attrs import evolve

from afm_scan_ros.core.comparison import residual_of, with_own_parameters
from afm_scan_ros.core.metrics import Scan
from afm_scan_ros.core.model import Added, ScannerModel
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.types import Trace
from afm_scan_ros.files import share_directory
from afm_scan_ros.files.plant_file import load_plant
from helpers.in_process import InProcessSession, default_model

PLANT = load_plant(share_directory() / "config/plant.yaml")
SPEC = ScanSpec(line_rate=20.0, lines=4, samples_per_line=500, preparation_cycles=3)
SCAN = InProcessSession(PLANT).scan("", SPEC, default_model())


def with_effects(*added: Added) -> ScannerModel:
    model = default_model()
    return evolve(model, x=evolve(model.x, added=added))


def disturbed(cosine: float, sine: float, frequency: float) -> Scan:
    """Return the scan with a wave in x that the scanner never made."""
    time = SPEC.sample_period * np.arange(len(SCAN.drive.x))
    phase = 2.0 * np.pi * frequency * time
    wave = cosine * np.cos(phase) + sine * np.sin(phase)
    x, y = SCAN.measured.x + wave, SCAN.measured.y
    return evolve(SCAN, measured=Trace(0, SPEC.sample_period, x, y))


def test_the_phase_is_fitted_and_the_frequency_kept() -> None:
    scan = disturbed(3e-7, -4e-7, 50.0)
    believed = with_effects(Added("periodic_disturbance", "", (-2e-7, 0.0, 50.0)))
    fitted = with_own_parameters(believed, scan)
    ((cosine, sine, frequency),) = (added.values for added in fitted.x.added)
    assert frequency == 50.0
    np.testing.assert_allclose([cosine, sine], [3e-7, -4e-7], atol=2e-9)
    healthy = residual_of(default_model(), SCAN, "x").std()
    assert residual_of(fitted, scan, "x").std() < 1.01 * healthy
    assert residual_of(believed, scan, "x").std() > 5.0 * healthy


def test_a_model_without_such_parameters_is_left_as_it_is() -> None:
    delayed = with_effects(Added("delay", "", (1e-4,)))
    assert with_own_parameters(delayed, SCAN) is delayed
