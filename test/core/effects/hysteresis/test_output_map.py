"""Laws of the map behind a Preisach operator."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from afm_scan_ros.core.effects.hysteresis.preisach import OutputMap, terms
from afm_scan_ros.core.errors import InputError

SMALL = st.lists(st.floats(-0.05, 0.05), max_size=4).map(tuple)
OUTPUTS = np.linspace(-3.0, 4.0, 301)


@given(SMALL)
def test_it_is_undone_within_its_range_and_beyond(coefficients: tuple[float, ...]) -> None:
    behind = OutputMap(-2.0, 3.0, coefficients)
    np.testing.assert_allclose(behind.output(behind.input(OUTPUTS)), OUTPUTS, atol=1e-13)


@given(SMALL)
def test_it_is_what_the_docstring_says(coefficients: tuple[float, ...]) -> None:
    outputs = np.linspace(-2.0, 3.0, 41)
    expected = outputs + terms(outputs, -2.0, 3.0, len(coefficients)) @ np.array(coefficients)
    np.testing.assert_allclose(
        OutputMap(-2.0, 3.0, coefficients).input(outputs), expected, atol=1e-13
    )


@given(SMALL)
def test_the_ends_stay_where_they_are(coefficients: tuple[float, ...]) -> None:
    ends = np.array([-2.0, 3.0])
    np.testing.assert_allclose(OutputMap(-2.0, 3.0, coefficients).input(ends), ends, atol=1e-14)


def test_a_map_that_turns_back_is_refused() -> None:
    with pytest.raises(InputError, match="turns back at an effective input of -2 V"):
        OutputMap(-2.0, 3.0, (1.5,))


def test_an_empty_range_is_refused() -> None:
    with pytest.raises(InputError, match="lower < upper"):
        OutputMap(1.0, 1.0, ())
