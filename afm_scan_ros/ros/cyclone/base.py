"""What the backend's parts share: names and arguments, errors, quality of service and log lines.

Names and command-line arguments of nodes are as rcl reads them. Relative names are expanded, then
remapped. Arguments between ``--ros-args`` and ``--`` are parsed. The rest is under rclpy's names.
"""

import re
import sys
import time
from collections.abc import Callable, Sequence
from enum import IntEnum
from pathlib import Path
from types import CodeType
from typing import Protocol

from attrs import Factory, define, field, frozen

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.files.yaml import Value, load, parse

_WORD = r"[A-Za-z_][A-Za-z0-9_]*"
_NODE_NAME = re.compile(_WORD)
_NAME = re.compile(rf"(~/|/)?{_WORD}(/{_WORD})*|~")
_NAMESPACE = re.compile(rf"/|(/{_WORD})+")


@frozen
class Remap:
    """One rule ``[node:]source:=target``; ``__node`` and ``__ns`` are sources too."""

    node: str | None
    source: str
    target: str

    def applies_to(self, node: str) -> bool:
        """Return whether the rule is for every node or for this one."""
        return self.node in (None, node)


def node_name(given: str, rules: Sequence[Remap]) -> str:
    """Name of a node after ``-r __node:=name``; raises ValueError for one that ROS refuses."""
    name = _first(rules, given, ("__node", "__name")) or given
    if not _NODE_NAME.fullmatch(name):
        raise ValueError(f"'{name}' is no node name: use letters, digits and underscores")
    return name


def namespace(name: str, rules: Sequence[Remap]) -> str:
    """Namespace of the node that was called ``name``, after ``-r __ns:=/name``."""
    found = _first(rules, name, ("__ns",)) or "/"
    absolute = found if found.startswith("/") else f"/{found}"
    if not _NAMESPACE.fullmatch(absolute):
        raise ValueError(f"'{found}' is no namespace: give it as /afm or /lab/afm")
    return absolute


def resolve(name: str, node: str, space: str, rules: Sequence[Remap]) -> str:
    """Full name of topic or service ``name`` of a node, remapped by the first rule that fits."""
    full = _expand(name, node, space)
    for rule in rules:
        special = rule.source.startswith("__")
        if not special and rule.applies_to(node) and _expand(rule.source, node, space) == full:
            return _expand(rule.target, node, space)
    return full


def _expand(name: str, node: str, space: str) -> str:
    if not _NAME.fullmatch(name):
        raise ValueError(f"'{name}' is no topic or service name")
    root = space.rstrip("/")
    if name.startswith("/"):
        return name
    if name.startswith("~"):
        return f"{root}/{node}{name[1:]}"
    return f"{root}/{name}"


def _first(rules: Sequence[Remap], node: str, sources: tuple[str, ...]) -> str | None:
    targets = (r.target for r in rules if r.source in sources and r.applies_to(node))
    return next(targets, None)


_ASSIGNMENT = re.compile(r"(?:(?P<node>[^:=]+):)?(?P<name>[^:=]+):=(?P<value>.*)", re.DOTALL)


@define
class Arguments:
    """The remap rules and parameter overrides of a process, in the order given."""

    remaps: list[Remap] = Factory(list)
    overrides: dict[str, dict[str, Value]] = Factory(dict)

    def for_node(self, full_name: str) -> dict[str, Value]:
        """Values given for the parameters of a node.

        As in rcl, values lie below the key that they were given for; of several keys that fit,
        the one that was named first on the command line counts least.
        """
        found: dict[str, Value] = {}
        for key, values in self.overrides.items():
            if _matches(key, full_name):
                found.update(values)
        return found


def _remap(found: Arguments, text: str) -> None:
    node, source, target = _assignment(text, "-r")
    found.remaps.append(Remap(node, source, target))


def _parameter(found: Arguments, text: str) -> None:
    node, name, value = _assignment(text, "-p")
    parsed = parse(value, f"-p {name}")
    if parsed is None:
        raise InputError(f"-p {text}: no value; write -p {name}:=VALUE")
    found.overrides.setdefault(node or "/**", {})[name] = parsed


def _file(found: Arguments, text: str) -> None:
    path = Path(text)
    for key, section in load(path).items():
        if not isinstance(section, dict) or list(section) != ["ros__parameters"]:
            raise InputError(f"{path}: below '{key}:' put 'ros__parameters:' and nothing else")
        values = section["ros__parameters"]
        if not isinstance(values, dict):
            raise InputError(f"{path}: below 'ros__parameters:' put 'name: value' lines")
        found.overrides.setdefault(key, {}).update(_flat(values, ""))


_OPTIONS: dict[str, Callable[[Arguments, str], None]] = {
    "-r": _remap,
    "--remap": _remap,
    "-p": _parameter,
    "--param": _parameter,
    "--params-file": _file,
}


def parse_arguments(arguments: Sequence[str]) -> Arguments:
    """Read the ROS arguments of a command line; all others are left to the program.

    Raises InputError for an option that is unknown, incomplete or not supported here.
    """
    found = Arguments()
    ours = iter(_ros_words(arguments))
    for option in ours:
        if option not in _OPTIONS:
            raise InputError(f"--ros-args {option}: not supported; use -p, -r or --params-file")
        value = next(ours, None)
        if value is None:
            raise InputError(f"--ros-args {option}: its value is missing")
        _OPTIONS[option](found, value)
    return found


def _ros_words(arguments: Sequence[str]) -> list[str]:
    words, within = [], False
    for word in arguments:
        if word in ("--ros-args", "--"):
            within = word == "--ros-args"
        elif within:
            words.append(word)
    return words


def _assignment(text: str, option: str) -> tuple[str | None, str, str]:
    match = _ASSIGNMENT.fullmatch(text)
    if match is None:
        raise InputError(f"{option} {text}: write it as {option} NAME:=VALUE")
    return match["node"], match["name"], match["value"]


def _flat(values: dict[str, Value], prefix: str) -> dict[str, Value]:
    found: dict[str, Value] = {}
    for name, value in values.items():
        if isinstance(value, dict):
            found.update(_flat(value, f"{prefix}{name}."))
        else:
            found[prefix + name] = value
    return found


def _matches(key: str, full_name: str) -> bool:
    """Return whether a key such as ``/**/scanner`` or ``scanner`` means the node of this name."""
    absolute = key if key.startswith("/") else f"/{key}"
    pattern = re.escape(absolute).replace(r"/\*\*", r"(/\w+)*").replace(r"/\*", r"/\w+")
    return re.fullmatch(pattern, full_name) is not None


class NotInitializedError(RuntimeError):
    """A node was made or spun before ``init`` or after ``shutdown``."""


class ExternalShutdownException(Exception):  # noqa: N818 - rclpy's name
    """The domain was left while an executor was to wait."""


class InvalidHandle(Exception):  # noqa: N818 - rclpy's name
    """A node was asked for something after ``destroy_node``."""


class RCLError(RuntimeError):
    """DDS did not take a message."""


class SignalHandlerOptions(IntEnum):
    """Which signals ``init`` takes over; here it takes none."""

    NO = 0


class Waker(Protocol):
    """Ends the wait of an executor."""

    def set(self, value: bool) -> object:  # noqa: FBT001 - the binding's
        """End it."""
        ...


@define(eq=False)
class Joined:
    """What a process has joined: the arguments of its nodes, and what wakes its executors."""

    arguments: Arguments
    wakers: list[Waker] = field(factory=list, init=False)

    def wake(self) -> None:
        """Let every executor look at what it waits for again."""
        for waker in self.wakers:
            waker.set(True)


@frozen
class TopicEndpointInfo:
    """A publisher or subscription, with what this package's nodes use of rclpy's record."""

    topic_type: str


class HistoryPolicy(IntEnum):
    """How many samples are kept; numbers as in rmw/types.h."""

    KEEP_LAST = 1
    KEEP_ALL = 2


class ReliabilityPolicy(IntEnum):
    """Whether a lost sample is sent again."""

    RELIABLE = 1
    BEST_EFFORT = 2


class DurabilityPolicy(IntEnum):
    """Whether a reader that comes late still gets what was written."""

    TRANSIENT_LOCAL = 1
    VOLATILE = 2


@frozen(kw_only=True)
class QoSProfile:
    """Policies of one publisher or subscription; the defaults are ROS 2's.

    Raises ValueError for keep-last without a depth, as rclpy does.
    """

    history: HistoryPolicy = HistoryPolicy.KEEP_LAST
    depth: int = 0
    reliability: ReliabilityPolicy = ReliabilityPolicy.RELIABLE
    durability: DurabilityPolicy = DurabilityPolicy.VOLATILE

    def __attrs_post_init__(self) -> None:
        if self.history == HistoryPolicy.KEEP_LAST and self.depth < 1:
            raise ValueError("QoSProfile: history KEEP_LAST needs a depth of at least 1")


def profile_of(qos: QoSProfile | int) -> QoSProfile:
    """Return a profile where rclpy takes a profile or a depth."""
    return qos if isinstance(qos, QoSProfile) else QoSProfile(depth=qos)


@frozen
class Logger:
    """Writes ``[LEVEL] [seconds] [name]: text``, as ROS 2's console output.

    Raises ValueError, as rclpy does, where one place in the code logs at a second severity.
    """

    name: str
    _severities: dict[tuple[CodeType, int], str] = field(factory=dict, init=False, eq=False)

    def info(self, message: str) -> None:
        """Say what happens."""
        self._write("INFO", message)

    def warning(self, message: str) -> None:
        """Say what is not as it should be, and goes on."""
        self._write("WARN", message)

    def error(self, message: str) -> None:
        """Say what ends the work."""
        self._write("ERROR", message)

    def _write(self, level: str, message: str) -> None:
        caller = sys._getframe(2)  # noqa: SLF001 - the place that logs, as rclpy tells them apart
        if self._severities.setdefault((caller.f_code, caller.f_lasti), level) != level:
            raise ValueError("Logger severity cannot be changed between calls.")
        line = f"[{level}] [{time.time():.9f}] [{self.name}]: {message}\n"
        sys.stderr.write(line)
        sys.stderr.flush()
