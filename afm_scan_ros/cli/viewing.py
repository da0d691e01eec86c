"""What a viewer is that a feature opens beside a scan, where the option of its name says so."""

from collections.abc import Callable
from contextlib import AbstractContextManager
from typing import Protocol

from attrs import frozen

from afm_scan_ros.bag.live import BlockViewer, ScanListener
from afm_scan_ros.core.scan_info import ScanInfo


class ViewingListener(ScanListener, BlockViewer, Protocol):
    """Is told how a scan goes on, and sees its blocks."""


@frozen
class ScanView:
    """A viewer that a feature opens beside a scan, which never waits for it.

    ``help`` is that of the option, and ``usual`` its value where it has none. The value says where
    the scan is shown; ``refuse`` raises InputError where it cannot be. Beside a scan in this
    process the viewer takes the place of the listener that it is given, and passes all on to it.
    """

    help: str
    usual: str
    refuse: Callable[[str], None]
    beside_pipeline: Callable[
        [str, ScanInfo, ScanListener], AbstractContextManager[ViewingListener]
    ]
    beside_nodes: Callable[[str, ScanListener], AbstractContextManager[None]]
