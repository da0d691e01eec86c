"""Names and command-line arguments of nodes, as rcl reads them.

Relative names are expanded, then remapped. Arguments between ``--ros-args`` and ``--`` are parsed.
"""

import re
from collections.abc import Callable, Sequence
from pathlib import Path

from attrs import Factory, define, frozen

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
