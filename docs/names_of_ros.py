"""Lets the reference of the nodes be made where there is no ROS: their modules name parts of it."""

import sys
from abc import ABCMeta
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec
from types import ModuleType
from typing import Any

from afm_scan_ros.nodes import lacking_ros

PACKAGES = (
    *("rclpy", "rcl_interfaces", "afm_scan_ros.msg", "std_msgs", "sensor_msgs", "std_srvs"),
    *("diagnostic_msgs", "lifecycle_msgs"),
)


@contextmanager
def names_of_ros() -> Iterator[None]:
    """Import modules of nodes to read what they declare; without ROS, they are forgotten then."""
    if not lacking_ros():
        yield
        return
    before, finder = set(sys.modules), _Names()
    sys.meta_path.insert(0, finder)
    try:
        yield
    finally:
        sys.meta_path.remove(finder)
        for name in sorted(set(sys.modules) - before, reverse=True):  # a part before its package
            del sys.modules[name]
            parent, _, child = name.rpartition(".")
            if parent in sys.modules:
                vars(sys.modules[parent]).pop(child, None)


class _Name(ABCMeta):
    """A class of which nothing is known but its name, as are all that it has."""

    def __getattr__(cls, name: str) -> "_Name":
        if name.startswith("__"):
            raise AttributeError(name)
        return _named(name)


def _named(name: str) -> _Name:
    def keep(self: Any, *_: object, **given: object) -> None:  # noqa: ANN401 - of any class
        vars(self).update(given)

    return _Name(name, (), {"name": name, "__init__": keep})


class _Names(MetaPathFinder, Loader):
    """Finds modules of ROS, every name in which is a class."""

    def find_spec(self, fullname: str, *_: object) -> ModuleSpec | None:
        """Find what is part of ROS."""
        if any(f"{fullname}.".startswith(f"{package}.") for package in PACKAGES):
            return ModuleSpec(fullname, self, is_package=True)
        return None

    def exec_module(self, module: ModuleType) -> None:
        """Let a module have every name."""
        vars(module)["__getattr__"] = _named
