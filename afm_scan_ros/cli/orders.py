"""What a scan or a record is made of, however it is run: by nodes, or in this process."""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

from attrs import field, frozen

from afm_scan_ros import features
from afm_scan_ros.bag.live import ScanListener
from afm_scan_ros.cli.options import CONFIG
from afm_scan_ros.cli.scanner import SIM, ScannerChoice
from afm_scan_ros.cli.viewing import ScanView, ViewingListener
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.drives.excitation import Plan
from afm_scan_ros.core.model import ScannerModel
from afm_scan_ros.core.scan_info import ScanInfo
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.files import yaml
from afm_scan_ros.files.plant_file import node_parameters
from afm_scan_ros.nodes.parameters import NodeParameter

COMPENSATOR, MONITOR = "inversion_compensator", "residual_monitor"

Parameters = Mapping[str, object]


@frozen
class ScanFiles:
    """What a scan is made from, and the folder of the bag that it ends in.

    ``plant`` is that of the ``scanner`` sim. ``learned`` is a learned correction of this scan.
    """

    spec: Path
    model: Path
    plant: Path
    bag: Path
    scanner: str = SIM
    learned: Path | None = None


@frozen(eq=False)
class ScanOrder:
    """A scan.

    ``flow`` are parameters of its source that its file sets. ``own`` are those of the other parts
    by their names, before those of their files. With ``images`` it is imaged, ``watched`` its
    residual is monitored. ``views`` say where each viewer shows it, by the viewer's name.
    """

    files: ScanFiles
    spec: ScanSpec
    flow: Mapping[str, Any]
    model: ScannerModel
    inverses: tuple[str, ...]
    scanner: ScannerChoice
    time_scale: float
    own: Mapping[str, Parameters]
    images: bool
    watched: bool
    views: Mapping[str, str] = field(factory=dict)


@frozen(eq=False)
class RecordOrder:
    """A drive through a plan, recorded in a bag; ``own`` are parameters of the scanner."""

    plan: Plan
    bag: Path
    title: str
    scanner: ScannerChoice
    time_scale: float
    own: Parameters


def refuse_pace(time_scale: float) -> None:
    """Raise InputError for a time scale that is none."""
    if not 0.0 <= time_scale < math.inf:
        raise InputError(f"time_scale = {time_scale:g}: give 1 for real time, 0 for no pacing")


def file_of(part: str) -> Path:
    """Return the file with the parameters of a part of a scan."""
    return CONFIG / f"{part}.yaml"


def settings_of(part: str, parameters: Iterable[NodeParameter], own: Parameters) -> dict[str, Any]:
    """Return a part's parameters: its own before those of its file, and these before defaults."""
    given = {**parameters_of(part), **own}
    return {each.name: given.get(each.name, each.default) for each in parameters}


def parameters_of(part: str) -> dict[str, Any]:
    """Return the parameters that this file sets."""
    path = file_of(part)
    return node_parameters(yaml.load(path), str(path), part)


VIEWS: Mapping[str, ScanView] = features.views()
"""The viewers that features open beside a scan, by the names of their options."""


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
