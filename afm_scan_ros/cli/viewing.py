"""Viewers beside a scan, which features open where the option of their name says so."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager
from typing import Protocol

from attrs import frozen

from afm_scan_ros import features
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


VIEWS: Mapping[str, ScanView] = features.views()


@contextmanager
def viewed(
    views: Mapping[str, str], info: ScanInfo, listener: ScanListener
) -> Iterator[Sequence[ViewingListener]]:
    """Show a scan of this process where each viewer of a name is told to; the last hears first."""
    found: list[ViewingListener] = []
    with ExitStack() as open_views:
        for name, where in views.items():
            view = VIEWS[name].beside_pipeline(where, info, found[-1] if found else listener)
            found.append(open_views.enter_context(view))
        yield found
