"""Node: desired displacement in, through the inverse of the scanner's model, drive voltage out."""

import time
from collections.abc import Iterable, Iterator
from math import floor, log10
from pathlib import Path

import numpy as np

from afm_scan_ros.bag.scan_info import ScanInfo
from afm_scan_ros.core.compensation import Compensation, Progress, Ranges, largest_ranges, preflight
from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.learning.adaptation import Adaptation
from afm_scan_ros.core.learning.adapted_scan import AdaptedScan
from afm_scan_ros.core.learning.line_feedback import LEAD, FedBack, LineFeedback, lines_of_delay
from afm_scan_ros.core.model import INVERSES, InverseSettings
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.streams import end, part
from afm_scan_ros.core.types import Trace
from afm_scan_ros.files.learned_file import load_learned
from afm_scan_ros.files.model_file import model_hash
from afm_scan_ros.files.records import naming
from afm_scan_ros.nodes.block_consumer import BlockConsumer, min_subscriptions, spec_of
from afm_scan_ros.nodes.messages import MAX_BLOCK
from afm_scan_ros.nodes.parameters import (
    ADAPTATION,
    DRIVE_LIMITS,
    MODEL_FILE,
    NodeParameter,
    drive_limits,
    inverses_of,
    model_of,
)
from afm_scan_ros.nodes.peers import RUNNING, Report
from afm_scan_ros.nodes.topics import ACHIEVED, DESIRED, DRIVE, NodeTopic

DEFAULTS = InverseSettings()


class InversionCompensator(BlockConsumer):
    """Inverts the scan once before it begins, to check it at rest, and again block by block."""

    NAME = "inversion_compensator"

    PARAMETERS = (
        MODEL_FILE,
        NodeParameter("inverses", list(INVERSES), "Effects to invert: creep, ...; or none"),
        NodeParameter(
            "hysteresis_inverse",
            DEFAULTS.hysteresis_inverse,
            "Inverse of hysteresis: exact, the paper's direct inverse, or the model's choice",
            choices=("as_identified", "exact", "direct"),
        ),
        NodeParameter(
            "weight_corner_hz",
            DEFAULTS.weight_corner,
            "Frequency above which the inverse limits the drive",
            low=1.0,
        ),
        NodeParameter(
            "weight_order", DEFAULTS.weight_order, "Steepness of that transition", low=1, high=10
        ),
        NodeParameter(
            "preview_ms", DEFAULTS.preview * 1e3, "Preview of the inverse", low=0.0, high=1000.0
        ),
        *DRIVE_LIMITS,
        NodeParameter("learned_file", "", "Learned correction of this scan; empty for none"),
        NodeParameter(
            "preflight_samples",
            5_000_000,
            "Largest scan, in samples, that is inverted before it begins",
            low=0,
        ),
        NodeParameter(
            "line_feedback",
            default=False,
            description="Whether offset, tilt and gain are corrected from the last lines",
        ),
        NodeParameter(
            "feedback_latency_ms",
            LEAD * 1e3,
            "With line_feedback or adapt: longest time from a sample's drive to its reading",
            low=0.0,
            high=10_000.0,
        ),
        *ADAPTATION,
        min_subscriptions(2),
    )

    def __init__(self) -> None:
        super().__init__()
        self._model = model_of(self.settings)
        for axis in self._model.axes:
            for effect, _ in self._model.axis(axis).effects.unknown():
                self.get_logger().warning(f"{axis}: the model does not know {effect}: left out")
        self._inverses = inverses_of(self.settings["inverses"], INVERSES)
        self._compensation: Compensation
        self._progress: Progress
        self._fed_back: FedBack | None = None
        self._adapted: AdaptedScan | None = None
        self._end: int | None = None
        self._driven = 0
        self._moved_at = 0.0
        waits = self.settings["line_feedback"] or self.settings["adapt"]
        self.read([DESIRED, ACHIEVED] if waits else [DESIRED])
        file = self.settings["learned_file"]
        with naming("parameter learned_file"):
            self._learned = load_learned(Path(file)) if file else None
        self._stop: int | None = None
        self.write(DRIVE, self.settings["min_subscriptions"])

    def prepare(self, info: ScanInfo) -> Iterator[str]:
        """Refuse a scan that is of another model, or that cannot be driven."""
        self._refuse_other(info)
        self._compensation = self._built(info.sample_period)
        self._progress, spec = self._compensation.at_rest(), spec_of(info)
        if self.settings["line_feedback"]:
            self._fed_back = self._feedback(spec)
        if self.settings["adapt"]:
            self._adapted = self._adaptation(spec)
        samples = min(info.total_samples, self.settings["preflight_samples"])
        if self._learned is not None:
            with naming(self.settings["learned_file"]):
                self._learned.refuse_other(spec, self._model, self._inverses)
            yield from preflight(self._compensation, spec, samples, self._learned.correction)
            return
        try:
            yield from preflight(self._compensation, spec, samples)
        except ScanError as error:
            found = yield from largest_ranges(self._compensation, spec, samples)
            raise ScanError(f"{error}; {_advice(found)}") from error

    def step(self) -> bool:
        """End a scan that waits for readings which never come."""
        self._refuse_late_readings()
        return super().step()

    def consume(self, topic: NodeTopic, block: Trace, *, last: bool) -> None:
        """Publish the drive that follows from a block; after the last one, the whole rest."""
        if topic is DESIRED:
            self._refuse_narrow_window(len(block.x))
            self._end = end(block) if last else None
        self._moved_at = time.monotonic()
        for corrected in self._corrected(topic, block):
            self._drive(corrected, last=end(corrected) == self._end)

    def _corrected(self, topic: NodeTopic, block: Trace) -> Iterator[Trace]:
        """Yield what is to be followed now: what is desired, with all corrections."""
        references = self._referred(topic, block)
        if self._adapted is None:
            yield from references
            return
        for reference in references:
            yield from self._adapted.desired(reference)
        if topic is ACHIEVED:
            yield from self._adapted.achieved(block)

    def _referred(self, topic: NodeTopic, block: Trace) -> Iterable[Trace]:
        """Return what is desired with what was learned and with line feedback."""
        if topic is ACHIEVED:
            return () if self._fed_back is None else self._fed_back.achieved(block)
        reference = block
        if self._learned is not None:
            self._stop, reference = self._learned.correction.follow(self._stop, block)
        if self._fed_back is None:
            return [reference]
        return self._fed_back.desired(block, reference)

    def _drive(self, block: Trace, *, last: bool) -> None:
        try:
            self._progress, drive = self._compensation.invert(self._progress, block)
            owed = self._compensation.finish(self._progress) if last else None
        except ScanError as error:
            raise ScanError(f"{error}{self._corrected_by()}") from error
        if owed is not None:
            x, y = np.append(drive.x, owed.x), np.append(drive.y, owed.y)
            drive = Trace(drive.first_sample, drive.sample_period, x, y)
        for first in range(drive.first_sample, end(drive), MAX_BLOCK):
            stop = min(first + MAX_BLOCK, end(drive))
            self.send(DRIVE, part(drive, first, stop), last=last and stop == end(drive))
        self._driven = end(drive)
        if self._adapted is not None:
            self._adapted.driven(drive)

    def _corrected_by(self) -> str:
        if self._fed_back is None:
            return ""
        moved = self._fed_back.corrected_by().items()
        corrections = ", ".join(f"{axis} by {1e6 * offset:.3g} µm" for axis, offset in moved)
        return f"; line feedback corrects {corrections}"

    def _delay(self, spec: ScanSpec) -> int:
        """Lines from one that is measured to the first that can follow from it."""
        latency = self.settings["feedback_latency_ms"] * 1e-3
        return lines_of_delay(spec, self._compensation.held_back, latency)

    def _adaptation(self, spec: ScanSpec) -> AdaptedScan:
        adaptation = Adaptation(self._model, spec, self.settings["adapt_time_constant_s"])
        return AdaptedScan(self._model, spec, adaptation, self._delay(spec))

    def _feedback(self, spec: ScanSpec) -> FedBack:
        delay = self._delay(spec)
        law = LineFeedback(spec, delay)
        self.get_logger().info(
            f"line feedback: line k is corrected by lines up to k - {delay}; drifts slower than"
            f" {law.bandwidth:.3g} Hz are reduced"
        )
        return FedBack(spec, law)

    def _refuse_late_readings(self) -> None:
        """Raise ScanError where the scanner is finished with a drive whose reading is missing."""
        if self.state != RUNNING:
            return
        waiting = (each.awaited for each in (self._fed_back, self._adapted) if each is not None)
        line = min((line for line in waiting if line is not None), default=None)
        scanner = self._scanner() if line is not None else None
        if scanner is None or scanner.next_sample < self._driven:
            return
        if time.monotonic() - self._moved_at > self.settings["liveness_timeout_s"]:
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

    def _built(self, sample_period: float) -> Compensation:
        given = self.settings
        settings = InverseSettings(
            hysteresis_inverse=given["hysteresis_inverse"],
            weight_corner=given["weight_corner_hz"],
            weight_order=given["weight_order"],
            preview=given["preview_ms"] * 1e-3,
        )
        limits = drive_limits(given)
        return Compensation(self._model, sample_period, self._inverses, settings, limits)

    def _refuse_other(self, info: ScanInfo) -> None:
        if info.model_hash != model_hash(self._model):
            raise InputError(
                f"model_file {self.settings['model_file']} is not the model of scan"
                f" '{info.scan_id}': give the source and the compensator the same file"
            )
        if frozenset(info.inverses) != self._inverses:
            ours, theirs = (", ".join(sorted(i)) or "none" for i in (self._inverses, info.inverses))
            raise InputError(f"inverses: {ours} here, but {theirs} in scan '{info.scan_id}'")

    def _refuse_narrow_window(self, block_size: int) -> None:
        preview = round(self.settings["preview_ms"] * 1e-3 / self.scan.sample_period)
        if self.scan.window < (least := preview + 2 * block_size):
            raise ScanError(
                f"window = {self.scan.window} is less than the preview and two blocks:"
                f" give at least {least}"
            )


def _advice(ranges: Ranges) -> str:
    if not ranges:
        return "no range is possible, for the preparation alone goes beyond"
    largest = ", ".join(f"{axis} {_rounded_down(1e6 * each):g} µm" for axis, each in ranges.items())
    return f"the largest range of this scan: {largest}"


def _rounded_down(value: float) -> float:
    """Return a number of three digits that is no larger, but for rounding."""
    digit = 10.0 ** (floor(log10(value)) - 2)
    return floor(round(value / digit, 6)) * digit
