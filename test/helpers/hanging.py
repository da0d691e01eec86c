"""Nodes, one of which hangs in its work once it has begun."""

import ctypes
import sys
import time
from typing import NoReturn

from afm_scan_ros.nodes.run import node_class, run_node
from afm_scan_ros.nodes.scan_node import ScanNode

LONG = 600
"""Seconds."""
WAYS = {"waiting": time.sleep, "locked": ctypes.PyDLL(None).sleep}
"""While one waits its heartbeat goes on; the other keeps the interpreter to itself."""


def start(name: str, victim: str, way: str) -> NoReturn:
    """Be a node."""
    kind = node_class(name)
    if name == victim:
        work = kind.step

        def step(self: ScanNode) -> bool:
            if self.next_sample:
                WAYS[way](LONG)
            return work(self)

        kind.step = step  # type: ignore[method-assign]
    sys.exit(run_node(name))
