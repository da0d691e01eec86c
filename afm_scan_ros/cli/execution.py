"""Executes what is ordered: by nodes where there is ROS, in this process elsewhere."""

from collections.abc import Mapping
from functools import cache, partial
from pathlib import Path
from typing import Any

import click
from attrs import evolve

from afm_scan_ros.cli import orders
from afm_scan_ros.cli.progress import showing
from afm_scan_ros.cli.scanner import SIM_NODE, ScannerChoice
from afm_scan_ros.core.identification.drives.excitation import excitation_block
from afm_scan_ros.core.scan_info import ScanInfo, info_of_scan
from afm_scan_ros.core.scan_inversion import ScanInversion
from afm_scan_ros.core.trajectory import desired
from afm_scan_ros.drivers import DriverChoice, load_settings
from afm_scan_ros.files.drive_files import load_learned
from afm_scan_ros.files.model_file import model_hash
from afm_scan_ros.nodes import has_rclpy, lacking_ros
from afm_scan_ros.nodes.inversion_parameters import (
    INVERSION,
    MONITORING,
    inversion_settings,
    scan_monitor,
)
from afm_scan_ros.nodes.parameters import (
    FLOW,
    SIMULATION,
    USUAL_WINDOW,
    block_size_at,
    checked,
    identity,
    simulated_scanner,
)
from afm_scan_ros.pipeline import ScanChain, run


def execute_scan(order: orders.ScanOrder) -> None:
    """Scan; raises InputError before it begins, ScanError where it stays incomplete."""
    if nodes_can_run():
        from afm_scan_ros.cli import by_nodes  # noqa: PLC0415 - needs ROS

        by_nodes.scan(order)
    else:
        _scan(order)


def execute_record(order: orders.RecordOrder) -> None:
    """Drive the scanner through a plan; raises as ``execute_scan`` does."""
    if nodes_can_run():
        from afm_scan_ros.cli import by_nodes  # noqa: PLC0415 - needs ROS

        by_nodes.record(order)
    else:
        _record(order)


@cache
def nodes_can_run() -> bool:
    """Return whether nodes can run; a ROS without this package's messages is told of once."""
    lacking = lacking_ros()
    if lacking and has_rclpy():
        click.echo(f"afm-scan: {lacking}; all runs in this process instead", err=True)
    return not lacking


def how_scans_run() -> str:
    """Return what executes scans, to be said after 'each scan ran'."""
    driver = "and the scanner's driver in another"
    if nodes_can_run():
        return f"by nodes of ROS 2, a process each, {driver}"
    return f"without ROS 2, as a pipeline in one process {driver}"


def _scan(order: orders.ScanOrder) -> None:
    """Scan in this process."""
    files, spec = order.files, order.spec
    flow = _flow({**order.flow, **order.scanner.source}, str(files.spec))
    own = orders.settings_of(orders.COMPENSATOR, INVERSION, order.own.get(orders.COMPENSATOR, {}))
    given = inversion_settings({**own, "inverses": order.inverses})
    info = evolve(
        info_of_scan(spec, *identity(flow["scan_id"])),
        inverses=tuple(sorted(given.inverses)),
        model_hash=model_hash(order.model),
    )
    learned = load_learned(files.learned).correction if files.learned else None
    monitor = None
    if order.watched:
        watched = orders.settings_of(orders.MONITOR, MONITORING, order.own.get(orders.MONITOR, {}))
        monitor = scan_monitor(order.model, spec, watched)
    chain = ScanChain(
        block=partial(desired, spec),
        driver=_driver(order.scanner, order.own.get(order.scanner.node, {})),
        scanner=order.scanner.node,
        streams=("desired_displacement", *order.scanner.topics),
        time_scale=order.time_scale,
        inversion=ScanInversion(order.model, spec, given, learned),
        preflight=min(info.total_samples, own["preflight_samples"]),
        monitor=monitor,
        **_flowing(info, flow),
    )
    with (
        showing(f"scan to {files.bag}") as shown,
        orders.viewed(order.views, info, shown) as viewers,
    ):
        run(chain, files.bag, viewers[-1] if viewers else shown, viewers)


def _record(order: orders.RecordOrder) -> None:
    """Drive the scanner through a plan in this process."""
    plan, flow = order.plan, _flow(order.scanner.source, order.plan.name)
    info = ScanInfo(*identity(""), plan.name, plan.sample_period, plan.total_samples)
    chain = ScanChain(
        block=partial(excitation_block, plan),
        driver=_driver(order.scanner, order.own),
        scanner=order.scanner.node,
        streams=order.scanner.topics,
        time_scale=order.time_scale,
        **_flowing(info, flow),
    )
    with showing(order.title) as shown:
        run(chain, order.bag, shown)


def _flow(given: Mapping[str, Any], where: str) -> dict[str, Any]:
    return {each.name: checked(each, given, where) for each in FLOW}


def _flowing(info: ScanInfo, flow: Mapping[str, Any]) -> dict[str, Any]:
    """Return the description of a scan, and the size of its blocks."""
    size = flow["block_size"] or block_size_at(info.sample_period)
    info = evolve(
        info,
        window=flow["window"] or USUAL_WINDOW * size,
        sampling_instant=flow["sampling_instant"],
        trigger_offset=flow["trigger_offset_s"],
    )
    return {"info": info, "block_size": size}


def _driver(scanner: ScannerChoice, own: orders.Parameters) -> DriverChoice:
    given = {**scanner.parameters, **own}
    if scanner.node == SIM_NODE:
        return simulated_scanner(orders.settings_of(SIM_NODE, SIMULATION, given), SIM_NODE)
    return load_settings(str(given["driver"]), Path(str(given["settings_file"])))
