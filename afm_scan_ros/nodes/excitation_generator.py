"""Node: publishes the drive voltage of an identification or diagnosis experiment."""

from pathlib import Path

from afm_scan_ros.core.identification.drives.excitation import excitation_block
from afm_scan_ros.core.identification.drives.experiments import KINDS, resized
from afm_scan_ros.core.scan_info import ScanInfo
from afm_scan_ros.core.types import Trace
from afm_scan_ros.files.drive_files import read_drive
from afm_scan_ros.nodes.block_source import BlockSource
from afm_scan_ros.nodes.flow import FLOW, identity, taking_part
from afm_scan_ros.nodes.parameters import NodeParameter
from afm_scan_ros.nodes.topics import DRIVE


class ExcitationGenerator(BlockSource):
    """The source of a calibration record or experiment: the drive itself, without an inverse."""

    NAME = "excitation_generator"

    PARAMETERS = (
        *FLOW,
        taking_part("piezoscanner_sim", "scan_recorder"),
        NodeParameter("kind", "creep", "Kind of record", choices=tuple(KINDS)),
        NodeParameter("amplitude_v", 0.0, "Amplitude; 0 for that of the kind", low=0.0),
        NodeParameter("duration_s", 0.0, "Length; 0 for that of the kind", low=0.0),
        NodeParameter(
            "drive_file", "", "Drive in place of a kind: .npz with drive_v (n, 2), sample_period_s"
        ),
    )

    def __init__(self) -> None:
        super().__init__(DRIVE)
        sizes = (self.settings[name] or None for name in ("amplitude_v", "duration_s"))
        file = self.settings["drive_file"]
        plan = read_drive(Path(file)) if file else KINDS[self.settings["kind"]]()
        self._plan = resized(plan, *sizes)
        scan_id, start = identity(self.settings["scan_id"])
        info = ScanInfo(
            scan_id,
            start,
            self._plan.name,
            self._plan.sample_period,
            self._plan.total_samples,
            nodes=self.nodes(),
        )
        self.announce(info)

    def block(self, first: int, count: int) -> Trace:
        """Return drive voltage, V."""
        return excitation_block(self._plan, first, count)
