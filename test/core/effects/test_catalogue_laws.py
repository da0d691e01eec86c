"""What every effect of the catalogue keeps to, in one table of all their forms."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import paper
import pytest
from attrs import evolve, frozen
from hypothesis import given, settings
from hypothesis import strategies as st

from afm_scan_ros.core.coupling import Coupling
from afm_scan_ros.core.effects.registry import CATALOGUE, entry
from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.model import INVERSES, Added, InverseSettings, ScannerModel
from afm_scan_ros.core.prediction import predict
from afm_scan_ros.core.scanner import compensator, forward
from afm_scan_ros.core.types import AXES, Trace

PERIOD = 5e-5
DESIGN = InverseSettings(preview=0.05)
"""A resonance that is added asks for a longer preview than the paper's."""
BASE = ScannerModel(paper.axis(), paper.axis())
HEIGHT = 4.0 * BASE.x.vibration.static_gain


@frozen
class Case:
    """An effect of a size that a scanner may have, and how exactly its inverse undoes it."""

    values: tuple[float, ...]
    band: float = 1e-3  # of the motion's height; that of the vibration's inverse


CASES = {
    ("backlash", ""): Case((5e-8,)),
    ("cross_coupling", "static"): Case((0.05,)),
    ("cross_coupling", "arc"): Case((4e3,)),
    ("cross_coupling", "dynamic"): Case((0.05, 300.0, 0.02)),
    ("cross_coupling", "modal"): Case((0.05, -0.02, 300.0, 0.02)),
    ("cross_coupling", "leg"): Case((0.05, 300.0, 0.05)),
    ("delay", ""): Case((1.3e-4,)),
    ("drift", ""): Case((1e-7, 30.0)),
    ("drift", "logarithmic"): Case((1e-7, 0.5)),
    ("extra_resonance", "rider"): Case((0.02, 1100.0, 0.03)),
    ("extra_resonance", "absorber"): Case((0.05, 700.0, 0.05)),
    ("extra_resonance", "parallel"): Case((0.05, 700.0, 0.02)),
    ("extra_resonance", "drive"): Case((2e-3, 0.05)),
    ("hysteretic_stiffness", ""): Case((0.1, 3e-6, 0.3)),
    ("hysteretic_stiffness", "spectrum"): Case((0.03, 0.04, 0.02, 0.01, 0.3)),
    ("input_lag", ""): Case((3e-4,)),
    ("parameter_shift", "gain"): Case((1.05,)),
    ("parameter_shift", "resonance"): Case((0.9, 1.5)),
    ("parameter_shift", "stiffness"): Case((0.95,)),
    ("parameter_shift", "creep"): Case((1.5, 0.5)),
    ("parameter_shift", "warmth"): Case((1.03, 1.5, 0.5)),
    ("parameter_shift", "hysteresis"): Case((0.8,)),
    ("periodic_disturbance", ""): Case((3e-8, -4e-8, 50.0)),
    ("periodic_disturbance", "hum"): Case(
        (3e-8, -4e-8, 50.0, 2e-8, 1e-8, 0.0, 1e-8, -1e-8, 0.0, 5e-9, 0.0, 0.0, 3e-9)
    ),
    ("periodic_disturbance", "driven_hum"): Case(
        (1e-2, -2e-2, 50.0, 2e-3, 1e-3, 0.0, 1e-3, -1e-3, 0.0, 5e-4, 0.0, 0.0, 3e-4)
    ),
    ("periodic_disturbance", "comb"): Case((3e-8, -4e-8, 20.0, *30 * (1e-9,))),
    ("rate_dependent_hysteresis", ""): Case((2e-4,)),
    ("rate_dependent_hysteresis", "film"): Case((2e-4,)),
    ("rate_dependent_hysteresis", "activated"): Case((2e-4, 0.02)),
    ("slew_limit", ""): Case((2e3,)),
    ("slew_limit", "uneven"): Case((2e3, 3e3)),
    ("slew_limit", "resistive"): Case((2e3, 3e3, 20.0)),
    ("slow_creep", ""): Case((0.05, 0.3)),
    ("slow_creep", "logarithmic"): Case((0.01, 0.05)),
    ("slow_creep", "power"): Case((0.1, 0.05, 3.0)),
    ("static_nonlinearity", ""): Case((1e3, 1e7)),
    ("static_nonlinearity", "odd"): Case((1e8,)),
    ("static_nonlinearity", "odd_quintic"): Case((1e8, 1e17)),
    ("static_nonlinearity", "quartic"): Case((1e3, 1e7, 1e11)),
    ("static_nonlinearity", "quintic"): Case((1e3, 1e7, 1e11, 3e15)),
    ("static_nonlinearity", "drive"): Case((0.01, -2e-3)),
    ("static_nonlinearity", "drive_odd_quintic"): Case((-4e-3, 2e-5)),
}
FORMS = [(each.name, form.kind) for each in CATALOGUE for form in each.forms]
every_form = pytest.mark.parametrize(("name", "kind"), FORMS)
seeds = st.integers(0, 2**32 - 1)
cuts = st.lists(st.integers(0, 400), max_size=5)


def extended(name: str, kind: str, values: Sequence[float]) -> ScannerModel:
    """Model with the effect on x."""
    added = Added(name, kind, values)
    return evolve(BASE, x=evolve(BASE.x, added=(added,)))


def drive(seed: int, samples: int) -> Trace:
    """Both axes, unlike; x jumps every 2 ms."""
    jumps = np.random.default_rng(seed).uniform(-0.5, 0.5, samples // 40)
    x, y = (paper.smooth_target(seed + i, samples, 3.0) for i in range(2))
    return Trace(0, PERIOD, x + np.repeat(jumps, 40), y)


def in_blocks(
    step: Callable[[Any, Any], tuple[Any, Any]], state: object, parts: Sequence[Any]
) -> list[Any]:
    """What a step gives for each block, the state handed on."""
    results = []
    for part in parts:
        state, result = step(state, part)
        results.append(result)
    return results


@every_form
def test_the_table_has_every_form(name: str, kind: str) -> None:
    form = entry(name).form(kind)
    for values in (CASES[name, kind].values, form.neutral):
        for parameter, value in zip(form.parameters, values, strict=True):
            assert parameter.lower <= value <= parameter.upper
            assert 0.0 < parameter.step < 1e-3 * (parameter.upper - parameter.lower)


@every_form
@settings(deadline=None, max_examples=4)
@given(seed=seeds)
def test_neutral_values_change_nothing(name: str, kind: str, seed: int) -> None:
    given_drive = drive(seed, 600)
    base = predict(BASE, given_drive)
    found = predict(extended(name, kind, entry(name).form(kind).neutral), given_drive)
    assert np.abs(found.x - base.x).max() <= 1e-12
    assert np.array_equal(found.y, base.y)


@every_form
def test_other_values_change_what_no_noise_hides(name: str, kind: str) -> None:
    given_drive = drive(3, 4000)
    changed = predict(extended(name, kind, CASES[name, kind].values), given_drive)
    assert np.std(changed.x - predict(BASE, given_drive).x) > 2e-9


@every_form
@settings(deadline=None, max_examples=8)
@given(seed=seeds, cut=cuts)
def test_blocks_change_nothing(name: str, kind: str, seed: int, cut: list[int]) -> None:
    model = extended(name, kind, CASES[name, kind].values)
    chain, inputs = forward(model.x, PERIOD), drive(seed, 400).x
    _, whole = chain.apply(chain.at_rest(), inputs)
    parts = np.concatenate(in_blocks(chain.apply, chain.at_rest(), np.split(inputs, sorted(cut))))
    assert np.abs(parts - whole).max() <= 1e-11 * HEIGHT
    coupling = Coupling(model, PERIOD)
    own = Trace(0, PERIOD, whole, whole[::-1].copy())
    blocks = [
        Trace(0, PERIOD, x, y)
        for x, y in zip(np.split(own.x, sorted(cut)), np.split(own.y, sorted(cut)), strict=True)
    ]
    steps = (coupling.apply, coupling.at_rest()), (coupling.invert, coupling.inverse_at_rest())
    for step, rest in steps:
        parts = in_blocks(step, rest, blocks)
        expected = step(rest, own)[1]
        joined = np.concatenate([part.x for part in parts])
        assert np.abs(joined - expected.x).max() <= 1e-10 * HEIGHT


@every_form
@settings(deadline=None, max_examples=4)
@given(seed=seeds, cut=cuts)
def test_inverting_in_blocks_changes_nothing(
    name: str, kind: str, seed: int, cut: list[int]
) -> None:
    model = extended(name, kind, CASES[name, kind].values)
    chain = compensator(model.x, PERIOD, INVERSES, DESIGN)
    targets = paper.smooth_target(seed, 400, 0.8 * HEIGHT)
    end, whole = chain.invert(chain.inverse_at_rest(), targets)
    state, parts = chain.inverse_at_rest(), []
    for block in np.split(targets, sorted(cut)):
        state, part = chain.invert(state, block)
        parts.append(part)
    for found, expected in (
        (np.concatenate(parts), whole),
        (chain.finish(state), chain.finish(end)),
    ):
        assert found.shape == expected.shape
        assert np.abs(found - expected).max(initial=0.0) <= 1e-10


@every_form
def test_no_inverse_after_that_of_vibration_looks_ahead(name: str, kind: str) -> None:
    """Compensation brings the axes into step before it, and expects them to stay so."""
    model = extended(name, kind, CASES[name, kind].values)
    last = compensator(model.x, PERIOD, INVERSES, DESIGN).effects[0]
    assert last.invert(last.inverse_at_rest(), np.zeros(10))[1].shape == (10,)


@every_form
@settings(deadline=None, max_examples=3)
@given(seed=seeds)
def test_the_extended_inverse_undoes_the_extended_model(name: str, kind: str, seed: int) -> None:
    """But for what no feedforward can undo, and for a millionth, which is left as it is."""
    model = extended(name, kind, CASES[name, kind].values)
    target = Trace(0, PERIOD, *(paper.smooth_target(seed + i, 1500, HEIGHT) for i in range(2)))
    expected = predict(BASE, driven(BASE, target))
    before = predict(model, driven(BASE, target))
    if entry(name).remedy == "none":
        expected = before
    after = predict(model, driven(model, target))
    for axis in AXES:
        error = np.abs(after.axis(axis) - expected.axis(axis)).max()
        assert error <= CASES[name, kind].band * HEIGHT
        undone = np.abs(before.axis(axis) - expected.axis(axis)).max()
        assert error <= 0.3 * undone + 1e-6 * HEIGHT


def driven(model: ScannerModel, target: Trace) -> Trace:
    """Drive by which the model's inverse follows a target from rest to rest."""
    coupling = Coupling(model, PERIOD)
    own, drives = coupling.invert(coupling.inverse_at_rest(), target)[1], {}
    for axis in AXES:
        chain = compensator(model.axis(axis), PERIOD, INVERSES, DESIGN)
        state, first = chain.invert(chain.inverse_at_rest(), own.axis(axis))
        drives[axis] = np.concatenate((first, chain.finish(state)))
    return Trace(0, PERIOD, **drives)


@every_form
def test_bounds_can_be_inserted_or_are_refused(name: str, kind: str) -> None:
    """A fit may try any corner of the box; it learns of a bad one by our own errors alone."""
    inputs = drive(0, 200).x
    bounds = np.array([(p.lower, p.upper) for p in entry(name).form(kind).parameters])
    random = np.random.default_rng(0)
    corners = np.unique(random.integers(0, 2, (200, len(bounds))), axis=0)
    some = random.permutation(corners)[:32]
    for corner in np.take_along_axis(bounds.T, some, axis=0):
        try:
            chain = forward(extended(name, kind, corner.tolist()).x, PERIOD)
            moved = chain.apply(chain.at_rest(), inputs)[1]
        except (InputError, ScanError):
            continue
        assert np.isfinite(moved).all()
