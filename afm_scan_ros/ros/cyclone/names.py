"""Topic and node names: relative names expanded, then remapped, as rcl does it."""

import re
from collections.abc import Sequence

from attrs import frozen

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
        """Tell whether the rule is for every node or for this one."""
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
