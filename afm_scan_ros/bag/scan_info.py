"""What a bag states of its scan: ``ScanInfo.msg`` as a record."""

from typing import Any

from attrs import asdict, frozen

from afm_scan_ros.bag.typestore import PACKAGE, Message, decode, encode, stamp_of
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.scan_spec import PATTERNS, ScanSpec, scan_parameters
from afm_scan_ros.core.trajectory import total_samples

TYPE = f"{PACKAGE}/ScanInfo"


@frozen
class ScanInfo:
    """What is needed to reproduce and to image a scan.

    ``start`` in ns since the epoch is the time of sample 0. ``spec`` is None for a record that is
    not a scan, as those of a calibration are; ``pattern`` then names what it is. ``model_hash`` is
    empty where no model was used. ``trigger_offset`` in s runs from the converter's update to the
    sensor's sample.
    """

    scan_id: str
    start: int
    pattern: str
    sample_period: float
    total_samples: int
    spec: ScanSpec | None = None
    inverses: tuple[str, ...] = ()
    model_hash: str = ""
    sampling_instant: str = "before_update"
    trigger_offset: float = 0.0
    window: int = 0
    nodes: tuple[str, ...] = ()

    def stamp(self, sample: int) -> int:
        """Time of a sample, ns: the same on all topics, whatever the clock does."""
        return self.start + round(sample * self.sample_period * 1e9)


def info_of_scan(spec: ScanSpec, scan_id: str, start: int) -> ScanInfo:
    """Describe a scan; ``attrs.evolve`` adds what else is known of it."""
    return ScanInfo(
        scan_id, start, spec.pattern, spec.sample_period, total_samples(spec), spec=spec
    )


def info_fields(info: ScanInfo) -> dict[str, Any]:
    """Return the fields of ``ScanInfo.msg`` but for its header."""
    unset: dict[str, Any] = {a.name: a.type() if a.type else None for a in scan_parameters()}
    fields = unset if info.spec is None else asdict(info.spec)
    own = asdict(info, filter=lambda a, _: a.name not in ("start", "spec"))
    lists = {"inverses": list(info.inverses), "nodes": list(info.nodes)}
    return {**fields, **own, **lists}


def info_from_message(message: Message) -> ScanInfo:
    """Read a ``ScanInfo`` message; raises InputError where it contradicts itself."""
    spec = None
    if message.pattern in PATTERNS:
        try:
            spec = ScanSpec(**{a.name: getattr(message, a.name) for a in scan_parameters()})
        except ValueError as error:
            raise InputError(f"scan_info: {error}") from error
    return ScanInfo(
        scan_id=message.scan_id,
        start=stamp_of(message),
        pattern=message.pattern,
        sample_period=float(message.sample_period),
        total_samples=int(message.total_samples),
        spec=spec,
        inverses=tuple(message.inverses),
        model_hash=message.model_hash,
        sampling_instant=message.sampling_instant,
        trigger_offset=float(message.trigger_offset),
        window=int(message.window),
        nodes=tuple(message.nodes),
    )


def encode_info(info: ScanInfo) -> bytes:
    """CDR of the ``ScanInfo`` message."""
    return encode(TYPE, info.start, info_fields(info))


def decode_info(cdr: bytes) -> ScanInfo:
    """Read a ``ScanInfo`` from its CDR; raises InputError where it is not one."""
    try:
        message = decode(TYPE, cdr)
    except ValueError as error:
        raise InputError(f"scan_info: {error}") from error
    return info_from_message(message)
