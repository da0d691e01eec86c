"""Node: desired displacement in, through the inverse of the scanner's model, drive voltage out."""

import time
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.scan_info import ScanInfo
from afm_scan_ros.core.scan_inversion import ScanInversion
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.trajectory import desired
from afm_scan_ros.core.types import Trace
from afm_scan_ros.files.drive_files import load_learned
from afm_scan_ros.files.model_file import model_hash
from afm_scan_ros.files.records import naming
from afm_scan_ros.nodes.block_consumer import BlockConsumer, min_subscriptions, spec_of
from afm_scan_ros.nodes.inversion_parameters import INVERSION, inversion_settings
from afm_scan_ros.nodes.parameters import MODEL_FILE, model_of
from afm_scan_ros.nodes.peers import RUNNING, Report
from afm_scan_ros.nodes.topics import ACHIEVED, DESIRED, DRIVE, NodeTopic


class InversionCompensator(BlockConsumer):
    """Inverts the scan once before it begins, to check it at rest, and again block by block."""

    NAME = "inversion_compensator"
    PARAMETERS = (MODEL_FILE, *INVERSION, min_subscriptions(2))

    @classmethod
    def warm_up(cls) -> None:
        """Invert a moment of a scan by the default model."""
        super().warm_up()
        defaults = {each.name: each.default for each in (MODEL_FILE, *INVERSION)}
        inversion = ScanInversion(model_of(defaults), ScanSpec(), inversion_settings(defaults))
        list(inversion.desired(desired(ScanSpec(), 0, 2), last=False))

    def __init__(self) -> None:
        super().__init__()
        self._model = model_of(self.settings)
        for axis in self._model.axes:
            for effect, _ in self._model.axis(axis).effects.unknown():
                self.get_logger().warning(f"{axis}: the records of the model do not tell {effect}")
        self._inversion: ScanInversion
        self._moved_at = 0.0
        self._given = inversion_settings(self.settings)
        self.read([DESIRED, ACHIEVED] if self._given.corrections else [DESIRED])
        file = self.settings["learned_file"]
        with naming("parameter learned_file"):
            self._learned = load_learned(Path(file)) if file else None
        self.write(DRIVE, self.settings["min_subscriptions"])

    def prepare(self, info: ScanInfo) -> Iterator[str]:
        """Refuse a scan that is of another model, or that cannot be driven."""
        self._refuse_other(info)
        spec, learned = spec_of(info), self._learned
        if learned is not None:
            with naming(self.settings["learned_file"]):
                learned.refuse_other(spec, self._model, self._given.inverses)
        correction = learned.correction if learned else None
        self._inversion = ScanInversion(self._model, spec, self._given, correction)
        if remark := self._inversion.remark:
            self.get_logger().info(remark)
        samples = min(info.total_samples, self.settings["preflight_samples"])
        yield from self._inversion.preflight(samples)

    def step(self) -> bool:
        """End a scan that waits for readings which never come."""
        self._refuse_late_readings()
        return super().step()

    def consume(self, topic: NodeTopic, block: Trace, *, last: bool) -> None:
        """Publish the drive that follows from a block; after the last one, the whole rest."""
        self._moved_at = time.monotonic()
        if topic is ACHIEVED:
            self._drive(self._inversion.achieved(block))
            return
        self._refuse_narrow_window(len(block.x))
        self._drive(self._inversion.desired(block, last=last))

    def counted(self) -> Sequence[str]:
        """Count what was desired: what was achieved waits for a scanner that may stand still."""
        return (DESIRED.name,)

    def _drive(self, blocks: Iterable[Trace]) -> None:
        for drive in blocks:
            self.send(DRIVE, drive, last=self._inversion.is_last(drive))

    def _refuse_late_readings(self) -> None:
        """Raise ScanError where the scanner is finished with a drive whose reading is missing."""
        if self.state != RUNNING:
            return
        line = self._inversion.awaited
        scanner = self._scanner() if line is not None else None
        if scanner is None or scanner.next_sample < self._inversion.driven:
            return
        if time.monotonic() - self._moved_at > 0.5 * self.longest_standstill():
            raise ScanError(
                f"the next line waits for the end of line {line}, which {scanner.node} has not"
                f" read: feedback_latency_ms = {self.settings['feedback_latency_ms']:g} is less"
                " than the scanner's latency; give more"
            )

    def _scanner(self) -> Report | None:
        """Return the last state of the node after this one in the data flow."""
        nodes = self.scan.nodes
        following = nodes[nodes.index(self.get_name()) + 1 :] if self.get_name() in nodes else ()
        return self.peers.of_scan(following[0]) if following else None

    def _refuse_other(self, info: ScanInfo) -> None:
        if info.model_hash != model_hash(self._model):
            raise InputError(
                f"model_file {self.settings['model_file']} is not the model of scan"
                f" '{info.scan_id}': give the source and the compensator the same file"
            )
        if frozenset(info.inverses) != self._given.inverses:
            both = self._given.inverses, info.inverses
            ours, theirs = (", ".join(sorted(each)) or "none" for each in both)
            raise InputError(f"inverses: {ours} here, but {theirs} in scan '{info.scan_id}'")

    def _refuse_narrow_window(self, block_size: int) -> None:
        if self.scan.window < (least := self._inversion.held_back + 2 * block_size):
            raise ScanError(
                f"window = {self.scan.window} is less than the preview and two blocks:"
                f" give at least {least}"
            )
