"""Compiling a loop is announced once; loading it from the cache is not."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from afm_scan_ros.core.compiled import compiled
from afm_scan_ros.core.errors import InputError

LOOPS = """
import logging, numpy
logging.basicConfig(format="%(name)s: %(message)s")
from afm_scan_ros.core.effects.creep import Creep, CreepModel
creep = Creep(CreepModel((0.1,), (1.0,)), 1e-3)
moved = creep.apply(creep.at_rest(), numpy.ones(3))[1]
creep.invert(creep.at_rest(), moved)
"""
"""Two loops run."""


def message(cache: Path) -> str:
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(cache)}
    command = [sys.executable, "-c", LOOPS]
    done = subprocess.run(command, capture_output=True, text=True, check=True, env=environment)
    return done.stderr


@pytest.mark.evidence
def test_compiling_is_said_once_and_a_warm_cache_is_quiet(tmp_path: Path) -> None:
    assert message(tmp_path) == (
        "afm_scan_ros.core.compiled: compiling loops for this machine, once after installation\n"
    )
    assert message(tmp_path) == ""


def test_a_missing_numba_is_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    """Ubuntu 24.04 has no package of it."""
    monkeypatch.setitem(sys.modules, "numba", None)
    with pytest.raises(InputError, match=r"numba.*: install numba, as by pip install 'numba>="):
        compiled(abs)(1.0)
