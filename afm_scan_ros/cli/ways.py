"""Runs what is ordered by nodes where there is ROS, in this process elsewhere."""

from functools import cache

import click

from afm_scan_ros.cli import by_pipeline
from afm_scan_ros.cli.orders import RecordOrder, ScanOrder
from afm_scan_ros.nodes import has_rclpy, lacking_ros


def scan_as_ordered(order: ScanOrder) -> None:
    """Scan; raises InputError before it begins, ScanError where it stays incomplete."""
    if nodes_can_run():
        from afm_scan_ros.cli import by_nodes  # noqa: PLC0415 - needs ROS

        by_nodes.scan(order)
    else:
        by_pipeline.scan(order)


def record_as_ordered(order: RecordOrder) -> None:
    """Record; raises as ``scan_as_ordered`` does."""
    if nodes_can_run():
        from afm_scan_ros.cli import by_nodes  # noqa: PLC0415 - needs ROS

        by_nodes.record(order)
    else:
        by_pipeline.record(order)


@cache
def nodes_can_run() -> bool:
    """Return whether nodes can run; a ROS without this package's messages is told of once."""
    lacking = lacking_ros()
    if lacking and has_rclpy():
        click.echo(f"afm-scan: {lacking}; all runs in this process instead", err=True)
    return not lacking
