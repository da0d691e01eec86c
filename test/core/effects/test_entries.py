"""What the entries say of themselves holds together."""

import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from afm_scan_ros.core.effects.registry import CATALOGUE, entry
from afm_scan_ros.core.effects.residual_features import ResidualFeatures
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.drives.experiments import EXPERIMENTS


def test_entries_stand_in_alphabetical_order() -> None:
    names = [e.name for e in CATALOGUE]
    assert names == sorted(set(names))


@pytest.mark.parametrize("name", [e.name for e in CATALOGUE])
def test_mistaking_goes_both_ways(name: str) -> None:
    found = entry(name)
    assert list(found.confusable) == sorted(set(found.confusable) - {name})
    for other in found.confusable:
        assert name in entry(other).confusable


@pytest.mark.parametrize("name", [e.name for e in CATALOGUE])
def test_the_experiment_is_one_that_can_be_made(name: str) -> None:
    assert entry(name).experiment in EXPERIMENTS


@pytest.mark.parametrize("name", [e.name for e in CATALOGUE])
def test_the_equation_names_every_parameter(name: str) -> None:
    found = entry(name)
    for form in found.forms:
        for parameter in form.parameters:
            named = re.sub("_([3-9]|[12][0-9])$", "_2", parameter.name)  # "and on"
            assert named in found.equation.replace(" w ", " frequency ")


def test_an_unknown_effect_is_refused_by_name() -> None:
    with pytest.raises(InputError, match=r"'magic': choose among .*cross_coupling"):
        entry("magic")


def test_an_unknown_kind_is_refused_by_name() -> None:
    with pytest.raises(InputError, match="cross_coupling has no kind 'odd': choose among 'static'"):
        entry("cross_coupling").form("odd")


@pytest.mark.parametrize(("name", "kind"), [(e.name, f.kind) for e in CATALOGUE for f in e.forms])
@settings(deadline=None, max_examples=10)
@given(
    seed=st.integers(0, 1000),
    lines=st.lists(st.floats(0.0, 1e4), max_size=4),
    height=st.sampled_from([0.0, 1e-5]),
)
def test_a_fit_can_start(
    name: str, kind: str, seed: int, lines: list[float], height: float
) -> None:
    random = np.random.default_rng(seed)
    moved = height * random.normal(size=500)
    features = ResidualFeatures(
        5e-5, moved / 1e-5, moved, random.normal(0.0, 1e-8, 500), moved, tuple(lines)
    )
    form = entry(name).form(kind)
    starts = list(form.starts(features))
    assert len(starts) <= 36
    assert starts or name == "periodic_disturbance"  # whose combs have none without a line
    for start in starts:
        for parameter, value in zip(form.parameters, start, strict=True):
            assert parameter.lower <= value <= parameter.upper
