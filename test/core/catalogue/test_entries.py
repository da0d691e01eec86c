"""What the entries say of themselves holds together."""

import pytest

from afm_scan_ros.core.catalogue import CATALOGUE, entry
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.experiments import EXPERIMENTS


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
            assert parameter.name in found.equation.replace(" w ", " frequency ")


def test_an_unknown_effect_is_refused_by_name() -> None:
    with pytest.raises(InputError, match=r"'magic': choose among .*cross_coupling"):
        entry("magic")


def test_an_unknown_kind_is_refused_by_name() -> None:
    with pytest.raises(InputError, match="cross_coupling has no kind 'odd': choose among 'static'"):
        entry("cross_coupling").form("odd")
