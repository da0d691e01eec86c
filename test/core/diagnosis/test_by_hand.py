"""A verdict can be computed by hand from ``diagnosis.json``, as the page of the method says."""

import numpy as np
import pytest

from afm_scan_ros.core.diagnosis.diagnosis import diagnose
from afm_scan_ros.core.diagnosis.residual_report import report_residual
from afm_scan_ros.core.model import ScannerModel
from afm_scan_ros.core.record import Record
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.report.diagnosis_json import Document, account_document
from helpers.in_process import ALL, default_model, scan
from helpers.spreads import known


@pytest.fixture(scope="module")
def document() -> Document:
    """Diagnosis of a healthy scan, of x alone, whose creep is known within a third."""
    spec = ScanSpec(line_rate=30.0, lines=6)
    done, axis = scan(spec, ALL), default_model().x
    record = Record.of_traces("scan", done.drive, done.measured, spec, axes=("x",))
    return account_document(report_residual(diagnose(ScannerModel(known(axis, 0.2)), [record])))


def test_the_log_likelihood_is_that_of_the_cells(document: Document) -> None:
    (record,) = document["residual"]["x"]
    cells = record["cells"]
    variance, nu, known = (np.array(cells[k]) for k in ("variance_m2", "freedom", "known_from"))
    none = document["likelihood"]["x"]["none"]
    ratio = np.array(none["cell_rms_m"]) ** 2 / variance
    by_hand = none["log_base"] - ((nu + known) / 2.0 * np.log1p(nu * ratio / known)).sum()
    assert none["log_likelihood"] == pytest.approx(by_hand, abs=1e-2)


def test_a_free_direction_costs_its_prior_and_its_volume(document: Document) -> None:
    deviations = document["model_deviations"]["x"]
    assert deviations
    assert document["likelihood"]["x"]["none"]["log_base"] < -0.5 * np.sum(np.square(deviations))


def test_the_probabilities_are_the_exponentials(document: Document) -> None:
    logs = {name: each["log_probability"] for name, each in document["likelihood"]["x"].items()}
    assert sum(np.exp(list(logs.values()))) == pytest.approx(1.0)
    assert document["probabilities"]["x"] == pytest.approx({n: np.exp(p) for n, p in logs.items()})
