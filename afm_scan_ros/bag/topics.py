"""Which topics of a bag hold the streams of a scan, whatever their names."""

from collections.abc import Mapping

from afm_scan_ros.bag.blocks import DISPLACEMENT, STREAMS, VOLTAGE
from afm_scan_ros.bag.scan_info import TYPE as SCAN_INFO
from afm_scan_ros.core.errors import InputError

TYPES = {**STREAMS, "scan_info": SCAN_INFO}
"""What a bag may hold of a scan, with the types."""

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
