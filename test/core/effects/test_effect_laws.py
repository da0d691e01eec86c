"""Laws that every form of every registered effect obeys, at the values of its example."""

from collections.abc import Callable, Mapping, Sequence
from functools import cache
from typing import Any

import numpy as np
import paper
import pytest
from attrs import evolve
from hypothesis import given, settings
from hypothesis import strategies as st

from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.effects.base import Cascade
from afm_scan_ros.core.effects.effect_type import PLACES
from afm_scan_ros.core.effects.registry import CATALOGUE, effect_type
from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.model import INVERSES, Added, InverseSettings, ScannerModel
from afm_scan_ros.core.scanner import Coupling, chain_of, forward, predict
from afm_scan_ros.core.types import AXES, Trace

PERIOD = 5e-5
DESIGN = InverseSettings(preview=0.05)
"""A resonance that is added asks for a longer preview than the paper's."""
BASE = ScannerModel(paper.axis(), paper.axis())
HEIGHT = 4.0 * BASE.x.vibration.static_gain


BAND = 1e-3
"""Of the motion's height: that of the vibration's inverse."""
FORMS = [
    pytest.param(each.name, form.kind, id=f"{each.name}-{form.kind}")
    for each in CATALOGUE
    for form in each.forms
]
every_form = pytest.mark.parametrize(("name", "kind"), FORMS)
seeds = st.integers(0, 2**32 - 1)
cuts = st.lists(st.integers(0, 400), max_size=5)


def example(name: str, kind: str) -> tuple[float, ...]:
    """Values of a size that a scanner may show."""
    return effect_type(name).form(kind).example


def extended(name: str, kind: str, values: Sequence[float]) -> ScannerModel:
    """Model with the effect on x."""
    added = Added(name, kind, values)
    return evolve(BASE, x=evolve(BASE.x, added=(added,)))


@cache
def compensating(name: str = "", kind: str = "") -> Cascade:
    """Compensator of an axis with an effect, or without; its design takes long."""
    axis = extended(name, kind, example(name, kind)).x if name else BASE.x
    return chain_of(axis).compensator(PERIOD, INVERSES, DESIGN)


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
def test_bounds_hold_the_example_and_the_neutral_values(name: str, kind: str) -> None:
    form = effect_type(name).form(kind)
    for values in (form.example, form.neutral):
        for parameter, value in zip(form.parameters, values, strict=True):
            assert parameter.lower <= value <= parameter.upper
            assert 0.0 < parameter.step < 1e-3 * (parameter.upper - parameter.lower)


@every_form
@settings(deadline=None, max_examples=4)
@given(seed=seeds)
def test_neutral_values_change_nothing(name: str, kind: str, seed: int) -> None:
    given_drive = drive(seed, 600)
    base = predict(BASE, given_drive)
    found = predict(extended(name, kind, effect_type(name).form(kind).neutral), given_drive)
    assert np.abs(found.x - base.x).max() <= 1e-12
    assert np.array_equal(found.y, base.y)


@every_form
def test_other_values_change_what_no_noise_hides(name: str, kind: str) -> None:
    given_drive = drive(3, 4000)
    changed = predict(extended(name, kind, example(name, kind)), given_drive)
    assert np.std(changed.x - predict(BASE, given_drive).x) > 2e-9


@every_form
def test_an_effect_changes_the_places_that_it_names_and_no_other(name: str, kind: str) -> None:
    form, chain = effect_type(name).form(kind), Chain(BASE.x)
    before, after = (_places(c) for c in (chain, form.insert(chain, np.array(form.example))))
    assert {place for place in PLACES if before[place] != after[place]} == set(form.places)


def _places(chain: Chain) -> dict[str, object]:
    """What a chain has in each place."""
    model = chain.model
    hysteresis = chain.hysteresis_of(model.hysteresis.forward), model.hysteresis.direct
    return {
        "drive": chain.drive,
        "hysteresis": hysteresis,
        "vibration": model.vibration,
        "creep": model.creep,
        "coupling": chain.coupling,
        "output": chain.output,
    }


@every_form
def test_equal_values_give_equal_elements(name: str, kind: str) -> None:
    form = effect_type(name).form(kind)
    one, same, other = (
        form.insert(Chain(BASE.x), np.array(values)).stages()
        for values in (form.example, form.example, form.neutral)
    )
    assert one == same
    assert hash(one) == hash(same)
    assert one != other


@every_form
@settings(deadline=None, max_examples=8)
@given(seed=seeds, cut=cuts)
def test_blocks_change_nothing(name: str, kind: str, seed: int, cut: list[int]) -> None:
    model = extended(name, kind, example(name, kind))
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
@settings(deadline=None, max_examples=2)
@given(seed=seeds, cut=cuts)
def test_inverting_in_blocks_changes_nothing(
    name: str, kind: str, seed: int, cut: list[int]
) -> None:
    chain = compensating(name, kind)
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
    last = compensating(name, kind).effects[0]
    assert last.invert(last.inverse_at_rest(), np.zeros(10))[1].shape == (10,)


@every_form
@settings(deadline=None, max_examples=3)
@given(seed=seeds)
def test_the_extended_inverse_undoes_the_extended_model(name: str, kind: str, seed: int) -> None:
    """But for what no feedforward can undo, and for a millionth, which is left as it is."""
    model = extended(name, kind, example(name, kind))
    target = Trace(0, PERIOD, *(paper.smooth_target(seed + i, 1500, HEIGHT) for i in range(2)))
    base = driven(BASE, {"x": compensating(), "y": compensating()}, target)
    expected, before = predict(BASE, base), predict(model, base)
    if effect_type(name).remedy == "none":
        expected = before
    chains = {"x": compensating(name, kind), "y": compensating()}
    after = predict(model, driven(model, chains, target))
    for axis in AXES:
        error = np.abs(after.axis(axis) - expected.axis(axis)).max()
        assert error <= BAND * HEIGHT
        undone = np.abs(before.axis(axis) - expected.axis(axis)).max()
        assert error <= 0.3 * undone + 1e-6 * HEIGHT


def driven(model: ScannerModel, chains: Mapping[str, Cascade], target: Trace) -> Trace:
    """Drive by which the model's inverse, and so each axis' chain, follows a target to rest."""
    coupling = Coupling(model, PERIOD)
    own, drives = coupling.invert(coupling.inverse_at_rest(), target)[1], {}
    for axis, chain in chains.items():
        state, first = chain.invert(chain.inverse_at_rest(), own.axis(axis))
        drives[axis] = np.concatenate((first, chain.finish(state)))
    return Trace(0, PERIOD, **drives)


@every_form
def test_bounds_can_be_inserted_or_are_refused(name: str, kind: str) -> None:
    """A fit may try any corner of the box; it learns of a bad one by our own errors alone."""
    inputs = drive(0, 200).x
    bounds = np.array([(p.lower, p.upper) for p in effect_type(name).form(kind).parameters])
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
