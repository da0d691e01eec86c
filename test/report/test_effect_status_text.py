"""How an effect is known, in words."""

import pytest

from afm_scan_ros.core.model import EffectStatus, ParameterInterval
from afm_scan_ros.report.sentences import intervals_text, status_text


@pytest.mark.parametrize(
    ("lower", "upper", "said"),
    [
        (-2e-3, 1e-3, "identified, none seen, 0 to 10 V"),
        (0.0, 1e-3, "identified, none seen, 0 to 10 V"),
        (1e-3, 2e-3, "identified, 0 to 10 V"),
        (None, 1e-3, "identified, 0 to 10 V"),
    ],
)
def test_an_effect_whose_interval_holds_zero_is_known_and_not_seen(
    lower: float | None, upper: float | None, said: str
) -> None:
    opening = ParameterInterval("opening", "V", lower, upper)
    status = EffectStatus(drive=(0.0, 10.0), intervals=(opening,))
    assert status_text(status) == said
    assert intervals_text(status).startswith("opening ")
