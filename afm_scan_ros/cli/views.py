"""The viewers that features open beside a scan, and a scan of this process shown by them."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager

from afm_scan_ros import features
from afm_scan_ros.bag.live import ScanListener
from afm_scan_ros.cli.viewing import ScanView, ViewingListener
from afm_scan_ros.core.scan_info import ScanInfo

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
