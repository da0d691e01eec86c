"""Mechanisms of drive_circuit.py, each against the solution of its equation."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import integrate

from afm_scan_bench.mechanisms import drive_circuit
from afm_scan_bench.mechanisms.drive_circuit import (
    CERAMIC_KNEE,
    CeramicFilter,
    GlitchingConverter,
    LooseContact,
    ResistiveElectrode,
    SharedGround,
)
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.types import Array
from helpers.acting import STEP, TIME, act


def test_a_ground_carries_a_share_of_the_other_axis() -> None:
    ground = SharedGround(axis="x", share=0.01, time_constant=50e-6)
    picked = act(ground, np.zeros(40), np.ones(40))
    expected = -0.01 * np.expm1(-STEP * np.arange(1, 41) / 50e-6)
    np.testing.assert_allclose(picked, expected, rtol=1e-9)


def test_a_converter_glitches_up_whichever_way_it_crosses_zero() -> None:
    drive = np.repeat([1.0, -1.0, -2.0, 1.0, 2.0], 8)
    spikes = act(GlitchingConverter(axis="x", height=0.4, lasting=12e-6), drive) - drive
    assert np.flatnonzero(spikes).tolist() == [8, 9, 10, 24, 25, 26]
    np.testing.assert_allclose(spikes[8:11], [0.4, 0.4, 0.16], atol=1e-12)


def test_charge_diffuses_along_an_electrode() -> None:
    """Against a ladder of many resistors and capacitors, under a drive that is held."""
    cells, constant = 400, 1e-4
    ladder = np.diag(np.full(cells, 2.0)) - np.eye(cells, k=1) - np.eye(cells, k=-1)
    ladder[0, 0], ladder[-1, -1] = 3.0, 1.0  # half a resistor from the wire; an open end
    rates, shapes = np.linalg.eigh(ladder * cells**2 / constant)
    shares = shapes.sum(axis=0) ** 2 / cells
    ends = STEP * np.arange(61)
    charged = ends - (shares / rates) @ -np.expm1(-np.outer(rates, ends))
    electrode = ResistiveElectrode(axis="x", resistance=1e3, capacitance=1e-7)
    np.testing.assert_allclose(act(electrode, np.ones(60)), np.diff(charged) / STEP, atol=6e-3)
    np.testing.assert_allclose(
        act(electrode, np.ones(60))[10:], (np.diff(charged) / STEP)[10:], atol=1e-5
    )


def test_an_electrode_is_late_by_a_third_of_its_time_constant() -> None:
    late = TIME - act(ResistiveElectrode(axis="x", resistance=1500.0, capacitance=1e-7), TIME)
    assert late[-1] == pytest.approx(50e-6, rel=1e-5)


@pytest.mark.parametrize("seed", range(3))
def test_a_piezo_without_a_lead_keeps_its_voltage(seed: int) -> None:
    """Against a simulation instant by instant."""
    contact, drive = LooseContact(axis="x", opened=300e-6), np.cumsum(np.ones(2000))
    _, _, changes = contact.at_rest(STEP, np.random.default_rng(seed))
    fine = STEP * (np.arange(2000 * 50) + 0.5) / 50
    count = np.searchsorted(changes, fine)
    opening = np.maximum(count - 1, 0)
    instant = np.where(count % 2 == 1, changes[opening], fine)
    simulated = drive[(instant / STEP).astype(int)].reshape(2000, 50).mean(axis=1)
    held = act(contact, drive, seed=seed)
    assert np.abs(held - drive).max() > 50.0
    np.testing.assert_allclose(held, simulated, atol=np.abs(held - drive).max() / 40)  # an edge
    assert np.abs(held - simulated).mean() < 0.1


def test_a_contact_that_has_opened_as_often_as_it_will_is_refused(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(drive_circuit, "CONTACT_OPENINGS", 3)
    with pytest.raises(InputError, match="outlasts 3 openings"):
        act(LooseContact(axis="x", opened=1e-6), np.zeros(40_000))


def capacitance(v: Array | float) -> Array:
    return np.asarray(10e-9 / np.cbrt(1.0 + (v / CERAMIC_KNEE) ** 2))


def test_a_ceramic_capacitor_charges_by_johnson() -> None:
    """Against scipy's solver, step by step of the drive: mean over each."""
    drive, resistance = np.repeat([4.0, -2.0, 0.5], 30), 2e4
    means, voltage = [], 0.0
    for u in drive:
        found = integrate.solve_ivp(
            lambda _, s, u=u: [(u - s[0]) / (resistance * capacitance(s[0])), s[0]],
            (0.0, STEP),
            [voltage, 0.0],
            rtol=1e-9,
            atol=1e-12,
        )
        voltage = found.y[0, -1]
        means.append(found.y[1, -1] / STEP)
    ceramic = CeramicFilter(axis="x", resistance=resistance, capacitance=10e-9)
    np.testing.assert_allclose(act(ceramic, drive), means, atol=1e-3)


@settings(deadline=None, max_examples=20)
@given(level=st.floats(-5.0, 5.0))
def test_a_ceramic_filter_is_late_by_what_capacitance_is_left(level: float) -> None:
    slope = 1e-2 / STEP  # V/s, for as long as a few time constants
    drive = level + slope * (TIME[:400] - TIME[399])
    ceramic = CeramicFilter(axis="x", resistance=5e3, capacitance=10e-9)
    late = (drive[-1] + 0.5 * slope * STEP - act(ceramic, drive)[-1]) / slope - 0.5 * STEP
    behind = capacitance(level - slope * 5e3 * capacitance(level))
    assert late == pytest.approx(5e3 * behind, rel=0.06)
