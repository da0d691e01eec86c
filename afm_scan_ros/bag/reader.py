"""Reads a scan back from a bag, whole or block by block, and sees that nothing is missing in it."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType

import numpy as np
from attrs import field, frozen

from afm_scan_ros.bag.folder import bag_files
from afm_scan_ros.bag.mcap_file import RawMessage, RawMessages, runs
from afm_scan_ros.bag.mcap_summary import outline
from afm_scan_ros.bag.scan_info import (
    DISPLACEMENT,
    STREAMS,
    VOLTAGE,
    BlockDecoder,
    Continuity,
    decode_block,
    decode_info,
    info_of_block,
)
from afm_scan_ros.bag.scan_info import TYPE as SCAN_INFO
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.scan_info import ScanInfo
from afm_scan_ros.core.streams import Aligner, end, part
from afm_scan_ros.core.types import AXES, Trace

TYPES = {**STREAMS, "scan_info": SCAN_INFO}
"""What a bag may hold of a scan, with the types."""

MOST_INFOS, LONGEST_INFO = 100, 2**16
"""Different messages of a topic that tells of one scan, and the bytes of one."""

_BY_TYPE = {VOLTAGE: "drive_voltage", DISPLACEMENT: "achieved_displacement", SCAN_INFO: "scan_info"}
"""What a topic of another name holds where it is the only one of its type."""


def assigned(there: Mapping[str, str], chosen: Mapping[str, str], where: object) -> dict[str, str]:
    """Return the topic of each stream that a bag holds, and of ``scan_info``.

    A stream is the topic that was chosen, or else that of its name in any namespace, or else the
    only one left of its type. Of several namespaces that of a chosen topic is taken.

    Arguments:
        there: the bag's topics, each with its type.
        chosen: names of streams, each with its topic.
        where: the bag, for errors.

    Raises InputError for a chosen topic that is not there or of another type, and where several
    topics could be one stream.
    """
    found = {name: _chosen(name, topic, there, where) for name, topic in chosen.items()}
    spaces = {_space(topic) for topic in chosen.values()}
    for name in TYPES.keys() - chosen.keys():
        named = [topic for topic in there if topic.rpartition("/")[2] == name]
        if topics := [t for t in named if _space(t) in spaces] or named:
            found[name] = _only(name, topics, there, where)
    for type_name, name in _BY_TYPE.items():
        left = [topic for topic in there if there[topic] == type_name]
        left = [topic for topic in left if topic not in found.values()]
        if name not in found and left:
            found[name] = _only(name, left, there, where)
    return found


def _chosen(name: str, topic: str, there: Mapping[str, str], where: object) -> str:
    if topic not in there:
        raise InputError(f"{where}: holds no topic {topic}, but {', '.join(sorted(there))}")
    return _only(name, [topic], there, where)


def _only(name: str, topics: list[str], there: Mapping[str, str], where: object) -> str:
    if len(topics) > 1:
        raise InputError(
            f"{where}: holds both {topics[0]} and {topics[1]}: say which one is {name}, as"
            f" --topic {name}={topics[0]}"
        )
    if there[topics[0]] != TYPES[name]:
        raise InputError(f"{where}: {topics[0]} is of type {there[topics[0]]}, not {TYPES[name]}")
    return topics[0]


def _space(topic: str) -> str:
    return topic.rpartition("/")[0]


_SAMPLE_BYTES = 2 * 8  # an x and a y in a file that is not compressed


@frozen(eq=False)
class ScanRecording:
    """A scan in a bag.

    Its streams are ``desired_displacement``, ``drive_voltage``, ``achieved_displacement`` and, from
    a simulator, ``true_displacement``, which is free of noise. ``topics`` maps those that are there
    to the bag's topics, whatever their names. ``warnings`` name what a crash lost. Where the
    bag holds no ``scan_info``, ``stated`` is false and ``info`` is what the first block states.
    """

    path: Path
    info: ScanInfo
    topics: dict[str, str]
    warnings: tuple[str, ...]
    _files: tuple[Path, ...] = field(repr=False)
    stated: bool = True

    def blocks(self, *names: str) -> Iterator[tuple[Trace, ...]]:
        """Yield runs of the same samples of all the streams named, in order, in little memory.

        It ends where the shortest stream ends. Raises InputError for a stream that is not in the
        bag, and for a gap, a repeat, another sample period, another scan or a NaN, naming topic
        and sample.
        """
        aligner = Aligner(names)
        for name, trace in self._traces(names, begin=0):
            aligner.add(name, trace)
            yield from aligner.ready()

    def whole(self, name: str) -> Trace:
        """Read all of one stream into memory; raises InputError as ``blocks``."""
        (trace,) = self._read((name,), begin=0)
        return trace

    def together(self, *names: str) -> tuple[Trace, ...]:
        """Read into memory what all the streams named hold, from whatever sample they begin at.

        Raises InputError as ``blocks``, and where they have no sample in common.
        """
        streams = self._read(names, begin=None)
        start = max(trace.first_sample for trace in streams)
        stop = min(end(trace) for trace in streams)
        if stop <= start and all(trace.x.size for trace in streams):
            reach = ", ".join(
                f"{name} {trace.first_sample} to {end(trace) - 1}"
                for name, trace in zip(names, streams, strict=True)
            )
            raise InputError(
                f"{self.path}: its streams have no sample in common ({reach}): record them together"
            )
        stop = max(start, stop)
        return tuple(part(trace, min(start, end(trace)), stop) for trace in streams)

    def missing(self, samples: int) -> int:
        """Samples that ``scan_info`` announces beyond so many; 0 where the bag holds none."""
        return self.info.total_samples - samples if self.stated else 0

    def _read(self, names: Sequence[str], begin: int | None) -> tuple[Trace, ...]:
        size = sum(file.stat().st_size for file in self._files)
        room = size // _SAMPLE_BYTES
        if self.stated:
            room = min(self.info.total_samples, room)
        samples = np.empty((len(names), len(AXES), room))
        firsts: dict[str, int] = {}
        counts = [0] * len(names)
        for name, trace in self._traces(names, begin):
            stream = names.index(name)
            firsts.setdefault(name, trace.first_sample)
            start, stop = counts[stream], counts[stream] + trace.x.size
            if stop > samples.shape[-1]:  # a compressed file, or more than announced
                more = np.empty((len(names), len(AXES), stop))
                samples = np.concatenate((samples, more), axis=-1)
            samples[stream, 0, start:stop], samples[stream, 1, start:stop] = trace.x, trace.y
            counts[stream] = stop
        return tuple(
            Trace(firsts.get(name, 0), self.info.sample_period, *both[:, :count])
            for name, both, count in zip(names, samples, counts, strict=True)
        )

    def _traces(self, names: Sequence[str], begin: int | None) -> Iterator[tuple[str, Trace]]:
        """Yield the blocks of streams as they lie in the bag, each with its stream's name."""
        checks = {n: Continuity(f"{self.path}: {n}", self.info, begin) for n in names}
        decoders = {self._topic(n): (n, BlockDecoder(STREAMS[n])) for n in names}
        for run in (run for file in self._files for run in runs(file)):
            if run.topic in decoders:
                name, decoder = decoders[run.topic]
                for trace in _traces(run, decoder, checks[name]):
                    yield name, trace

    def _topic(self, name: str) -> str:
        if name not in self.topics:
            mend = "; ".join(self.warnings) or "record this topic too"
            raise InputError(f"{self.path}: holds no {name}: {mend}")
        return self.topics[name]


def read_scan(path: Path, chosen: Mapping[str, str] = MappingProxyType({})) -> ScanRecording:
    """Open a bag: a rosbag2 folder or an ``.mcap`` file, also one that was cut short.

    ``chosen`` are topics of streams where names and types do not decide. Without ``scan_info``
    the first block of samples states what is known. Raises InputError where there are no blocks
    either, naming what is missing and what is there. Damage further in shows where it is read.
    """
    files, missing = bag_files(path)
    there: dict[str, str] = {}
    infos: dict[str, dict[bytes, None]] = {}
    for message in (message for file in files for message in outline(file, SCAN_INFO)):
        there[message.topic] = message.type_name
        if message.type_name == SCAN_INFO:
            different = infos.setdefault(message.topic, {})
            different[_short(message, path)] = None
            if len(different) > MOST_INFOS:
                raise InputError(
                    f"{path}: {message.topic} announces over {MOST_INFOS} scans: record one scan a"
                    " bag"
                )
    topics = assigned(there, chosen, path)
    info: ScanInfo | None = None
    for cdr in infos.get(topics.pop("scan_info", ""), ()):
        info = _info(cdr, info, path)
    if info is None and topics:
        first = _first_info(path, files, topics)
        warnings = (*missing, _without_info(path))
        return ScanRecording(path, first, topics, warnings, files, stated=False)
    if info is None:
        notes = "".join(f"; {warning}" for warning in missing)
        if not there:
            raise InputError(f"{path}: holds no messages at all{notes}")
        mend = f"; if it is one file of a bag, read {path.parent}" if path.is_file() else ""
        raise InputError(
            f"{path}: holds no scan_info of type {SCAN_INFO}, but {', '.join(sorted(there))}"
            f"{notes}{mend}"
        )
    return ScanRecording(path, info, topics, missing, files)


def _short(message: RawMessage, path: Path) -> bytes:
    """Return the CDR of a scan_info; raises InputError where it is too long for one."""
    if len(message.cdr) > LONGEST_INFO:
        raise InputError(
            f"{path}: {message.topic} has {len(message.cdr)} bytes, over {LONGEST_INFO}: it is no"
            " scan_info"
        )
    return message.cdr


def _info(cdr: bytes, before: ScanInfo | None, path: Path) -> ScanInfo:
    """Read the latched message, which may have been recorded more than once; not two scans."""
    try:
        info = decode_info(cdr)
    except InputError as error:
        raise InputError(f"{path}: {error}") from error
    if before is not None and before.scan_id != info.scan_id:
        raise InputError(
            f"{path}: holds scans '{before.scan_id}' and '{info.scan_id}': record one scan a bag"
        )
    return info


def _without_info(path: Path) -> str:
    mend = f"; if it is one file of a bag, read {path.parent}" if path.is_file() else ""
    return (
        f"{path}: holds no scan_info: it is taken as a record that was sampled just before the"
        f" converter's updates{mend}"
    )


def _first_info(path: Path, files: Sequence[Path], topics: dict[str, str]) -> ScanInfo:
    names = {topic: name for name, topic in topics.items()}
    for run in (run for file in files for run in runs(file)):
        if run.topic in names:
            try:
                return info_of_block(STREAMS[names[run.topic]], run.cdrs[0].tobytes())
            except ValueError as error:
                raise InputError(f"{path}: {names[run.topic]}: {error}") from error
    raise InputError(f"{path}: holds no readable samples: record it again")


def _traces(run: RawMessages, decoder: BlockDecoder, continuity: Continuity) -> Iterator[Trace]:
    together = decoder.together(run.cdrs)
    if together is not None:
        yield continuity.check(together)
        return
    for cdr in run.cdrs:
        try:
            block = decode_block(decoder.type_name, cdr.tobytes())
        except ValueError as error:
            where = f"{continuity.where}: sample {continuity.next_sample}"
            raise InputError(f"{where}: {error}") from error
        yield continuity.check(block)
