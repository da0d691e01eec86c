"""What the structure of a linear model lacks, of scanners that no code of the package moves."""

import numpy as np
import pytest

import afm_scan_ros as afm
from afm_scan_ros.report.diagnosis_json import account_document
from helpers.duffing import Oscillator, multisine

PERIOD, FINER = 1.0 / 610.0, 8
NOISE = 2e-10
HARDENING = Oscillator(cube=3e9)
LINEAR = HARDENING.omega / (2.0 * np.pi)
"""Hz."""
LOSING = Oscillator(loss=5e3 / Oscillator().omega)


def recorded(scanner: Oscillator, seed: int, count: int = 4000, **stated: str) -> afm.Record:
    """Return a record whose drive was measured, of a multisine that begins at rest."""
    fine = multisine(FINER * count, seed, share=0.3 / FINER)
    moved = scanner.moved(fine, PERIOD / FINER)[::FINER]
    moved = moved + NOISE * np.random.default_rng(seed).standard_normal(count)
    given = fine[::FINER], moved, PERIOD
    return afm.Record(
        *given, start="depolarised", intersample="band_limited", name=f"waves {seed}", **stated
    )


def identified(scanner: Oscillator) -> afm.Model:
    """Return a linear model of it."""
    records = [recorded(scanner, 1, 8000), recorded(scanner, 2, kind="validation")]
    return afm.identify(records, linear=True)


@pytest.fixture(scope="module")
def hardening() -> afm.Model:
    """A linear model of a spring that hardens."""
    return identified(HARDENING)


@pytest.fixture(scope="module")
def found(hardening: afm.Model) -> afm.Diagnosis:
    """What its structure lacks."""
    return afm.diagnose(hardening, [recorded(HARDENING, 3)], structure=True)


def error(model: afm.Model, record: afm.Record) -> float:
    """Standard deviation of what a model leaves of a record over that of its motion."""
    given = record.drive, record.sample_period
    left = record.displacement - model.predict(*given, beyond=0.5, intersample="band_limited")
    return float(np.std(left) / np.std(record.displacement))


@pytest.mark.evidence
def test_the_models_own_error_explains_the_residual_unless_asked(hardening: afm.Model) -> None:
    assert error(hardening, recorded(HARDENING, 4)) > 0.05
    assert afm.diagnose(hardening, [recorded(HARDENING, 3)]).verdict == "model_sufficient"


def test_a_spring_that_hardens_is_named(hardening: afm.Model, found: afm.Diagnosis) -> None:
    (effect,) = found.effects
    assert (effect.name, found.verdict) == ("nonlinear_spring", "effect_found")
    assert effect.probability > 0.95
    cubic = next(value for value in effect.values if value.parameter.name == "cubic")
    assert cubic.interval[0] < HARDENING.cube < cubic.interval[1]
    assert cubic.value == pytest.approx(HARDENING.cube, rel=0.1)
    fresh = recorded(HARDENING, 4)
    assert error(found.model, fresh) < 0.1 * error(hardening, fresh)


def test_the_resonance_is_that_of_the_spring_at_rest(
    hardening: afm.Model, found: afm.Diagnosis
) -> None:
    """The linear model was fitted around the spring; its file says what it was moved by."""
    before, after = (
        each.scanner.axis("x").vibration.natural_frequency for each in (hardening, found.model)
    )
    assert before > 1.005 * LINEAR
    assert after == pytest.approx(LINEAR, rel=2e-3)
    refitted = account_document(found.residual_report)["refitted"]["x"]
    assert before * refitted["frequency_factor"] == pytest.approx(after, rel=1e-9)


def test_the_extended_model_follows_by_its_inverse(
    hardening: afm.Model, found: afm.Diagnosis
) -> None:
    """A smooth path is followed by a scanner whose spring hardens, better than without."""
    period, count = 1e-4, 3000
    path = 2e-6 * np.sin(np.linspace(0.0, 6.0 * np.pi, count)) ** 3
    missed = []
    for each in (hardening, found.model):
        drive = each.invert(path, period)
        missed.append(float(np.std(HARDENING.moved(drive, period) - path)))
    assert missed[1] < 0.3 * missed[0]


@pytest.mark.evidence
def test_an_effect_that_the_catalogue_lacks_is_not_named() -> None:
    """A damper whose force grows with the cube of the speed."""
    model = identified(LOSING)
    assert error(model, recorded(LOSING, 4)) > 0.02
    diagnosis = afm.diagnose(model, [recorded(LOSING, 3)], structure=True)
    assert diagnosis.verdict == "unexplained"
    assert not diagnosis.effects
