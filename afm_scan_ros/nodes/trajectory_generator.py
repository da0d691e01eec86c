"""Node: publishes the desired displacement of a scan."""

from attrs import evolve
from std_srvs.srv import Trigger

from afm_scan_ros.core.model import INVERSES
from afm_scan_ros.core.scan_info import info_of_scan
from afm_scan_ros.core.trajectory import desired, phases, stopped, stopped_total
from afm_scan_ros.core.types import Trace
from afm_scan_ros.files.model_file import model_hash
from afm_scan_ros.nodes.block_source import BlockSource
from afm_scan_ros.nodes.declare import scan_spec
from afm_scan_ros.nodes.flow import FLOW, STOPPED, identity, taking_part
from afm_scan_ros.nodes.messages import Message
from afm_scan_ros.nodes.parameters import MODEL_FILE, NodeParameter, inverses_of, model_of
from afm_scan_ros.nodes.peers import RUNNING
from afm_scan_ros.nodes.topics import DESIRED


class TrajectoryGenerator(BlockSource):
    """The source of a scan; ``stop`` lets it end early, smoothly at rest at zero."""

    NAME = "trajectory_generator"

    PARAMETERS = (
        *FLOW,
        taking_part("inversion_compensator", "piezoscanner_sim", "scan_recorder"),
        NodeParameter("inverses", list(INVERSES), "Effects that the compensator inverts; or none"),
        MODEL_FILE,
    )

    def __init__(self) -> None:
        super().__init__(DESIRED)
        self._spec = scan_spec(self)
        self._stopped_at: int | None = None
        desired(self._spec, phases(self._spec).lines.start, 1)  # a line is computed here, not later
        self.create_service(Trigger, "stop", self._stop)
        info = evolve(
            info_of_scan(self._spec, *identity(self.settings["scan_id"])),
            inverses=tuple(sorted(inverses_of(self.settings["inverses"], INVERSES))),
            model_hash=model_hash(model_of(self.settings)),
            nodes=self.nodes(),
        )
        self.announce(info)

    def block(self, first: int, count: int) -> Trace:
        """Return desired displacement, m."""
        if self._stopped_at is None:
            return desired(self._spec, first, count)
        return stopped(self._spec, self._stopped_at, first, count)

    def _stop(self, _: Message, response: Message) -> Message:
        response.success = self.state == RUNNING
        if self.state != RUNNING:
            response.message = f"nothing to stop: the generator is {self.state}"
            return response
        if self._stopped_at is None:
            self._stopped_at = self.next_sample
            self.total = stopped_total(self._spec, self.next_sample)
            self.reason = f"{STOPPED} at sample {self.next_sample}"
        response.message = self.reason
        return response
