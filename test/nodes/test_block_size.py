"""The size of a block follows from the sample rate, unless somebody states it."""

import math
from collections.abc import Callable, Iterator
from contextlib import ExitStack

import pytest
from hypothesis import given
from hypothesis import strategies as st

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.streams import MAX_BLOCK
from afm_scan_ros.nodes.block_source import TrajectoryGenerator
from afm_scan_ros.nodes.parameters import LEAST_BLOCK, USUAL_RATE, block_size_at
from helpers.ros import joined

Generate = Callable[..., TrajectoryGenerator]


@given(st.floats(1.0, 1e7))
def test_a_topic_carries_no_more_messages_than_it_must(rate: float) -> None:
    size = block_size_at(1.0 / rate)
    assert LEAST_BLOCK <= size <= MAX_BLOCK
    if size < MAX_BLOCK:
        assert rate / size <= USUAL_RATE or math.isclose(rate / size, USUAL_RATE)
    if size > LEAST_BLOCK:
        assert rate / (size - 1) > USUAL_RATE


@pytest.mark.parametrize(
    ("rate", "size"), [(20e3, 400), (100e3, 2000), (100.0, 100), (1e6, 10_000)]
)
def test_round_rates_have_round_blocks(rate: float, size: int) -> None:
    assert block_size_at(1.0 / rate) == size


@pytest.fixture
def generate() -> Iterator[Generate]:
    """Return a function that makes a generator, at 20 kHz by default."""
    with ExitStack() as ended:

        def made(**given: object) -> TrajectoryGenerator:
            ended.enter_context(joined(**given))
            node = TrajectoryGenerator()
            ended.callback(node.destroy_node)
            return node

        yield made


@pytest.mark.parametrize(
    ("given_", "size", "window"),
    [
        ({}, 400, 8000),
        ({"block_size": 1000}, 1000, 20_000),
        ({"window": 900}, 400, 900),
        ({"samples_per_line": 200_000}, 10_000, 200_000),
    ],
)
def test_the_window_follows_from_the_block(
    generate: Generate, given_: dict[str, object], size: int, window: int
) -> None:
    generator = generate(min_subscriptions=0, **given_)
    generator.peers.names = ()
    generator.step()
    generator.step()
    assert (generator.next_sample, generator.scan.window) == (size, window)


def test_a_window_of_less_than_two_blocks_is_refused(generate: Generate) -> None:
    with pytest.raises(InputError, match=r"^window = 799 is less than two blocks: give at least 8"):
        generate(window=799)
