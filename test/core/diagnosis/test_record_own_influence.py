"""What is a record's own adds to the displacement alike, whatever is begun beside it."""

import numpy as np
from attrs import evolve

from afm_scan_ros.core.diagnosis.fit import Problem
from afm_scan_ros.core.diagnosis.preparation import evidence_of
from afm_scan_ros.core.effects.registry import effect_type
from afm_scan_ros.core.record import Record
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.scanner import chain_of
from helpers.in_process import ALL, default_model, scan

SPEC = ScanSpec(line_rate=20.0, lines=6, samples_per_line=500)
KEPT = np.array([[3e-8, -2e-8, 50.0], [1e-8, 4e-8, 50.0]])


def test_a_step_beside_what_is_known_is_the_step_that_knows_nothing() -> None:
    done, chain = scan(SPEC, ALL), chain_of(default_model().x)
    time, model = SPEC.sample_period * np.arange(len(done.drive.x)), default_model()
    evidence = []
    for number, (cosine, sine, frequency) in enumerate(KEPT):
        turned = 2.0 * np.pi * frequency * time
        hum = cosine * np.cos(turned) + sine * np.sin(turned)
        measured = evolve(done.measured, x=np.roll(done.measured.x, 1) + hum)
        observed = Record.of_traces("record", done.drive, measured, SPEC)
        evidence.append(evidence_of("x", model, observed, number))
    tone, delay = effect_type("periodic_disturbance").form(""), effect_type("delay").form("")
    own = Problem(evidence, chain, [tone]).influence_of_selected(KEPT)
    both = Problem(evidence, chain, [tone, delay])
    starts = [np.hstack((KEPT, np.full((2, 1), late))) for late in (1e-5, 1e-4)]
    knowing, ignorant = both.begin(starts, own), both.begin(starts)
    assert len(own) == 4  # a cosine and a sine in each of two records
    assert knowing is not None
    assert ignorant is not None
    np.testing.assert_allclose(knowing[0], ignorant[0], rtol=1e-6, atol=1e-14)
