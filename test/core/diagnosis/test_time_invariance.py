"""An effect that is kept is time-invariant wherever the records excite it."""

from typing import cast

import numpy as np
import pytest
from attrs import evolve, frozen

from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.diagnosis.axis_diagnosis import time_varying
from afm_scan_ros.core.diagnosis.candidates import Candidate, FittedCandidates
from afm_scan_ros.core.diagnosis.evidence import Evidence
from afm_scan_ros.core.diagnosis.fit import Problem
from afm_scan_ros.core.diagnosis.likelihood import CellFit
from afm_scan_ros.core.diagnosis.preparation import evidence_of
from afm_scan_ros.core.effects.registry import effect_type
from afm_scan_ros.core.metrics import Scan
from afm_scan_ros.core.record import Record
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.scanner import chain_of
from afm_scan_ros.core.types import Array
from helpers.in_process import ALL, default_model, scan

SPEC = ScanSpec(line_rate=20.0, lines=16, samples_per_line=500)
CHAIN = chain_of(default_model().x)
NO_CELLS = CellFit(*4 * (np.zeros(0),), 0.0)
CURVATURE = 500.0  # 1/m


@pytest.fixture(scope="module")
def healthy() -> Scan:
    return scan(SPEC, ALL)


def with_added(done: Scan, added: Array, number: int = 0) -> Evidence:
    measured = evolve(done.measured, x=done.measured.x + added)
    observed = Record.of_traces("scan", done.drive, measured, SPEC)
    found = evidence_of("x", default_model(), observed, number)
    return Evidence(found.playback, found.limit)


def changing(name: str, kind: str, *evidence: Evidence) -> tuple[int, ...]:
    """Places of what changes where this effect alone is fitted."""
    form = effect_type(name).form(kind)
    start = np.tile(form.neutral, (len(evidence), 1))
    found = Problem(evidence, CHAIN, [form]).descend(start)
    assert found is not None
    selected = FittedCandidates((Candidate(effect_type(name), form),), found, NO_CELLS)
    return tuple(time_varying(evidence, CHAIN, selected))


def test_a_gain_that_fades_is_no_gain(healthy: Scan) -> None:
    x = healthy.true.x
    left = 0.01 * np.linspace(0.0, 1.0, len(x))
    assert changing("parameter_shift", "gain", with_added(healthy, -0.005 * x)) == ()
    assert changing("parameter_shift", "gain", with_added(healthy, -left * x)) == (0,)


def test_the_square_of_the_other_axis_is_not_that_of_this_one(healthy: Scan) -> None:
    """In the preparation they are one, as both axes move together."""
    x, y = (0.5 * CURVATURE * place**2 for place in (healthy.true.x, healthy.true.y))
    assert changing("static_nonlinearity", "", with_added(healthy, x)) == ()
    assert changing("static_nonlinearity", "", with_added(healthy, y)) == (0,)
    assert changing("cross_coupling", "arc", with_added(healthy, y)) == ()
    assert changing("cross_coupling", "arc", with_added(healthy, x)) == (0,)


def test_all_records_must_agree(healthy: Scan) -> None:
    x = healthy.true.x
    less, as_much, more = (
        with_added(healthy, gain * x, number) for gain, number in ((4e-3, 0), (4e-3, 1), (8e-3, 1))
    )
    assert changing("parameter_shift", "gain", less, as_much) == ()
    assert changing("parameter_shift", "gain", less, more) == (0,)


@frozen(eq=False)
class Taken:
    """One effect and one record, in units of the floor: what it takes, and what is left; (n,)."""

    taken: Array
    left: Array
    candidates: tuple[str] = ("effect",)

    def extended(self, _: Chain) -> str:
        return "with it"

    def without(self, _: Chain, __: int) -> str:
        return "without it"

    def normalised_residual(self, chain: str) -> Array:
        return self.left if chain == "with it" else self.left + self.taken


@pytest.mark.parametrize(("seen", "changes"), [(1e-3, ()), (3.0, (0,))])
def test_no_size_is_stated_where_an_effect_is_not_excited(seen: float, changes: tuple[int]) -> None:
    """What is left of the last quarter has the shape of the effect, and five times the floor."""
    shape = np.cos(np.arange(4000.0))
    quarter = np.repeat([1.0, 1.0, 1.0, 0.0], 1000)
    known = Taken((3.0 * quarter + seen * (1.0 - quarter)) * shape, 5.0 * (1.0 - quarter) * shape)
    found = time_varying([cast("Evidence", known)], CHAIN, cast("FittedCandidates", known))
    assert tuple(found) == changes


@pytest.mark.parametrize(("change", "changes"), [(0.17, ()), (0.3, (0,))])
def test_an_amount_may_change_by_a_fifth(change: float, changes: tuple[int]) -> None:
    """A twentieth of the power of the whole effect, which is far above the limit."""
    shape = 1000.0 * np.cos(np.arange(4000.0))
    amount = np.repeat([1.0, -1.0, 1.0, -1.0], 1000)
    known = Taken(shape, change * amount * shape)
    found = time_varying([cast("Evidence", known)], CHAIN, cast("FittedCandidates", known))
    assert tuple(found) == changes
