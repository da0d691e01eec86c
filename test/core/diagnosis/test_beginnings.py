"""What is fitted is begun near what it is: a fit from far away ends elsewhere."""

import numpy as np
import pytest
from attrs import evolve

from afm_scan_ros.core.closed_loop import FIRST
from afm_scan_ros.core.diagnosis.candidates import Candidate, CandidateFitter
from afm_scan_ros.core.diagnosis.preparation import evidence_of
from afm_scan_ros.core.effects.registry import effect_type
from afm_scan_ros.core.effects.residual_features import ResidualFeatures
from afm_scan_ros.core.effects.vibration import VibrationModel
from afm_scan_ros.core.model import ScannerModel
from afm_scan_ros.core.record import Record
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.scanner import chain_of
from afm_scan_ros.core.types import Array, Trace
from afm_scan_ros.simulation.mechanisms.base import Mechanism
from afm_scan_ros.simulation.mechanisms.structure import CoupledStage, HeavierLoad
from helpers.in_process import InProcessSession, default_model, default_plant

SPEC = ScanSpec(line_rate=30.0, lines=6, samples_per_line=500)
SHARE = 0.03


def begun(mechanism: Mechanism, name: str, kind: str) -> Array:
    """Values from which a form is fitted to a scan of the default scanner with a mechanism."""
    plant = evolve(default_plant(), mechanisms=(mechanism,))
    done = InProcessSession(plant).scan(FIRST, SPEC, default_model())
    seen = evidence_of(
        "x", default_model(), Record.of_traces(FIRST, done.drive, done.measured, SPEC)
    )
    chain, view = chain_of(default_model().x), seen.playback.view
    residual = seen.residual(chain)
    features = ResidualFeatures(
        view.sample_period, view.drive, view.measured, residual, view.other, []
    )
    candidate = Candidate(effect_type(name), effect_type(name).form(kind))
    found = CandidateFitter((seen,), chain).begin(None, candidate, features)
    assert found is not None
    return found.rows[0]


@pytest.mark.parametrize("frequency", [330.0, 420.0, 540.0])
def test_a_coupled_mode_near_the_resonance_does_not_start_overdamped(frequency: float) -> None:
    stage = CoupledStage(axis="x", share=SHARE, frequency=frequency, damping=0.02)
    share, resonance, damping = begun(stage, "cross_coupling", "coupled_mode")
    assert share == pytest.approx(SHARE, rel=0.1)
    assert resonance == pytest.approx(frequency, rel=0.1)
    assert damping < 0.1


@pytest.mark.parametrize("mass", [0.1, 0.4, 0.6])
def test_a_load_is_begun_near_the_resonance_that_it_leaves(mass: float) -> None:
    factor, _ = begun(HeavierLoad(axis="x", mass_ratio=mass), "parameter_shift", "resonance")
    assert factor == pytest.approx((1.0 + mass) ** -0.5, rel=0.05)


def test_coupling_is_left_out_of_one_axis_without_a_resonance() -> None:
    """A stage that only lags has no resonance in which to begin a coupled mode."""
    lag = VibrationModel(numerator=(2e-3,), denominator=(1.0, 400.0))
    chain = evolve(chain_of(default_model().x), model=evolve(default_model().x, vibration=lag))
    drive = np.sin(np.arange(2000) / 100.0)
    driven, moved = Trace(0, 1e-3, drive, 0.0 * drive), Trace(0, 1e-3, 5e-6 * drive, 0.0 * drive)
    model = ScannerModel(x=chain.model)
    seen = evidence_of("x", model, Record.of_traces("one axis", driven, moved))
    view = seen.playback.view
    features = ResidualFeatures(
        view.sample_period, view.drive, view.measured, seen.residual(chain), view.other, []
    )
    candidate = Candidate(
        effect_type("cross_coupling"), effect_type("cross_coupling").form("coupled_mode")
    )
    assert CandidateFitter((seen,), chain).begin(None, candidate, features) is None
