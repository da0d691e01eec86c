"""Checks what a user gives to a function for its type."""

import os
from collections.abc import Iterable
from pathlib import Path
from typing import TypeVar

from afm_scan_ros.core.errors import InputError

Kind = TypeVar("Kind")

MODEL = "a model, as afm.load_model(path)"
RECORDS = "a list of records, as [afm.read_record(path)]"
IMAGE = "an image, as afm.read_image(path)"
IMAGES = "a list of images, as [afm.read_image(path)]"
SPEC = "a scan, as afm.ScanSpec(range_x=10e-6)"
LIMITS = "limits, as afm.DriveLimits(10.0, 1e5)"


def of_type(kind: type[Kind], name: str, given: object, fix: str) -> Kind:
    """Return an argument; raises InputError, with the ``fix``, where it is of another type."""
    if not isinstance(given, kind):
        raise InputError(f"{name} is of type {type(given).__name__}: give {fix}")
    return given


def all_of_type(kind: type[Kind], name: str, given: Iterable[Kind], fix: str) -> tuple[Kind, ...]:
    """Return all that an argument holds; raises InputError where anything is of another type."""
    if not isinstance(given, Iterable):
        raise InputError(f"{name} is of type {type(given).__name__}: give {fix}")
    return tuple(of_type(kind, f"{name}[{k}]", each, fix) for k, each in enumerate(given))


def path_of(name: str, given: object) -> Path:
    """Return a path; raises InputError for anything else."""
    if not isinstance(given, str | os.PathLike):
        raise InputError(f"{name} is of type {type(given).__name__}: give a path, as 'model.yaml'")
    return Path(given)
