"""What the options of several commands have in common."""

from collections.abc import Iterable
from pathlib import Path

import click

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.files.share import share_directory

CONFIG = share_directory() / "config"

FILE = click.Path(dir_okay=False, path_type=Path)
FOLDER = click.Path(file_okay=False, path_type=Path)
RECORD = click.Path(path_type=Path)
"""A rosbag2 folder or an .mcap file."""


def refuse_existing(*paths: Path, other: str = "folder") -> None:
    """Raise InputError for the first of these paths that is there already."""
    for path in paths:
        if path.exists():
            raise InputError(f"{path} exists already: give another {other} or remove it")


def warn(texts: Iterable[str]) -> None:
    """Write each text as a warning on stderr."""
    for text in texts:
        click.echo(f"warning: {text}", err=True)
