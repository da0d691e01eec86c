"""The text on a round, as far as it needs no diagnosis."""

from types import SimpleNamespace
from typing import Any

import pytest

from afm_scan_ros.report.close_loop import outcome
from afm_scan_ros.report.sentences import sentence


@pytest.mark.parametrize(("name", "message"), [("drift", 1), ("delay", 0)])
def test_a_drift_undone_is_said_to_be_a_replay(name: str, message: int) -> None:
    effect = SimpleNamespace(name=name, axis="x", values=())
    found = SimpleNamespace(by_axis={}, effects=[effect], cautions=())
    done: Any = SimpleNamespace(
        diagnosis=found,
        experiments=(),
        refusal="",
        comparisons={"same": None},
        worse={},
        kept=False,
    )
    assert list(outcome(done)).count(sentence("loop.replayed")) == message
