"""A sensor that nobody read is distinguished from one that reads the same again by chance."""

import numpy as np
import pytest

from afm_scan_ros.core.identification.records.samples import sensor_problems

STEP = 1e-9
"""Of the sensor, m; its noise is half of one."""


def messages_of(held: int) -> list[str]:
    """The messages on rest at an edge, where two readings take turns, but for ``held`` samples."""
    noise = 0.5 * np.random.default_rng(0).standard_normal(100_000)
    read = STEP * np.round(0.49 + noise)
    read[5_000 : 5_000 + held] = 0.0
    return list(sensor_problems("x", np.zeros(len(read)), read))


@pytest.mark.parametrize("held", [0, 35])
def test_what_one_reading_prevails_by_chance_is_no_gap(held: int) -> None:
    """Midway of a step two of three readings are the same; at an edge every second."""
    assert not messages_of(held)


def test_a_sensor_nobody_read_is_found() -> None:
    (message,) = messages_of(60)
    assert "displacement x stands still at 0 m" in message
