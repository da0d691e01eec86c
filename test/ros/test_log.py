"""Log lines keep to rclpy's rule: a place in the code logs at one severity."""

import pytest

from afm_scan_ros.ros.cyclone.base import Logger


def test_one_place_logs_at_one_severity() -> None:
    log = Logger("node")

    def tell(*, alarm: bool) -> None:
        (log.warning if alarm else log.info)("news")

    tell(alarm=False)
    tell(alarm=False)
    with pytest.raises(ValueError, match="severity cannot be changed"):
        tell(alarm=True)


def test_two_places_log_at_a_severity_each(capfd: pytest.CaptureFixture[str]) -> None:
    log = Logger("node")
    for news in ("first", "second"):
        log.info(news)
        log.warning(news)
    assert [line[:5] for line in capfd.readouterr().err.splitlines()] == ["[INFO", "[WARN"] * 2
