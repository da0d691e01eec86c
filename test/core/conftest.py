"""Fixtures of core's tests; the folder of this file is where they find ``paper``."""

import paper
import pytest

from afm_scan_ros.core.model import AxisModel


@pytest.fixture(scope="session")
def axis() -> AxisModel:
    """One axis of the paper's scanner."""
    return paper.axis()
