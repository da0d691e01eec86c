"""Which hysteresis operator is chosen for a family, from whole calibrations.

``afm-scan bench families`` does this for all families and maps.
"""

import numpy as np
import pytest

from afm_scan_bench.families.scanners import FamilyScanner
from afm_scan_ros.core.effects.hysteresis.everett import EverettSurface
from afm_scan_ros.core.identification.alternating import AxisRecord
from afm_scan_ros.core.identification.hysteresis.reversal_curves import reversal_curves
from afm_scan_ros.core.identification.identify import identify_axis


@pytest.mark.evidence
@pytest.mark.parametrize(("family", "operator"), [("slip", "preisach"), ("bouc_wen", "duhem")])
def test_the_operator_of_a_family_is_chosen(family: str, operator: str) -> None:
    """From full calibration records, between a square and a cubic map."""
    scanner = FamilyScanner.of(family, "square before, cube behind")
    creep, frequency, hysteresis, validation = scanner.records().values()
    found = identify_axis(creep, frequency, hysteresis, validation)
    choice, left = found.report.operator, found.model.model_discrepancy
    assert choice is not None
    assert left is not None
    assert choice.chosen == operator
    assert choice.record.startswith("hysteresis")
    assert np.linalg.norm(left.rms) < 2e-3 * np.linalg.norm(left.displacement)


@pytest.mark.evidence
def test_a_validation_record_chooses_where_no_loops_follow_the_curves() -> None:
    scanner = FamilyScanner.of("duhem", "none")
    creep, frequency, hysteresis, validation = scanner.records().values()
    end = reversal_curves(hysteresis.drive).end
    signals = hysteresis.drive[:end], hysteresis.displacement[:end]
    curves = AxisRecord(*signals, hysteresis.sample_period)
    found = identify_axis(creep, frequency, curves, validation)
    assert found.report.operator is not None
    assert (found.report.operator.record, found.report.operator.chosen) == ("validation", "duhem")
    assert found.report.exact is None
    alone = identify_axis(creep, frequency, curves)
    assert alone.report.operator is None
    assert isinstance(alone.model.hysteresis.forward, EverettSurface)
