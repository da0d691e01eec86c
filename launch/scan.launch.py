"""One scan, recorded: ros2 launch afm_scan_ros scan.launch.py bag:=scan1 scanner:=sim."""

from datetime import datetime
from pathlib import Path
from typing import Any

from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.events.process import ProcessExited
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

from launch import LaunchContext, LaunchDescription

CONFIG = Path(__file__).resolve().parents[1] / "config"

ARGUMENTS = [
    DeclareLaunchArgument(
        "bag",
        default_value=f"{datetime.now().astimezone():scan_%Y%m%d_%H%M%S}",
        description="Folder to make for the bag",
    ),
    DeclareLaunchArgument(
        "spec", default_value=str(CONFIG / "scan.yaml"), description="The scan: a parameter file"
    ),
    DeclareLaunchArgument(
        "model",
        default_value="",
        description="Model file to invert; by default config/model.yaml, for the simulated scanner"
        " alone",
    ),
    DeclareLaunchArgument(
        "scanner",
        default_value="sim",
        description="What scans: sim; external, a scanner_driver that is running already; or a"
        " driver with its settings file, as mylab:Stage:stage.yaml",
    ),
    DeclareLaunchArgument(
        "plant", default_value=str(CONFIG / "plant.yaml"), description="What the scanner sim is"
    ),
    DeclareLaunchArgument(
        "sample",
        default_value="grating",
        description="What is imaged: grating, a file (.npy or a picture), or none",
    ),
    DeclareLaunchArgument(
        "watch",
        default_value="true",
        choices=["true", "false"],
        description="Compare the scanner with the model as it scans, and say where it leaves it",
    ),
    DeclareLaunchArgument(
        "line_feedback",
        default_value="false",
        choices=["true", "false"],
        description="Correct offset, tilt and gain of each line from the lines before it",
    ),
    DeclareLaunchArgument(
        "adapt",
        default_value="false",
        choices=["true", "false"],
        description="Track changes of gain, resonance and slow creep, and scan accordingly",
    ),
    DeclareLaunchArgument(
        "inverses",
        default_value="creep,hysteresis,vibration",
        description="Effects to invert, with commas between; or none",
    ),
    DeclareLaunchArgument(
        "namespace", default_value="", description="Namespace of all nodes and topics"
    ),
    DeclareLaunchArgument(
        "time_scale", default_value="1.0", description="1 for real time, 0 as fast as possible"
    ),
]

Parameters = dict[str, Any]


def text(value: str) -> ParameterValue:
    """Keep a parameter text, where launch would read a name like 2026 as a number."""
    return ParameterValue(value, value_type=str)


def judge(event: ProcessExited, context: LaunchContext) -> None:
    """End the launch with status 1 at the first node that fails; after a good scan all end."""
    if event.returncode and not context.is_shutdown:
        raise RuntimeError(f"{event.process_name} ended with status {event.returncode}")


def model_of(model: str, scanner: str) -> str:
    """Return the model file; refuses to drive a real scanner by the simulated scanner's model."""
    default = str(CONFIG / "model.yaml")
    if not model and scanner.partition(":")[0] not in {"sim", "simulated"}:
        raise RuntimeError(
            f"scanner:={scanner}: give this scanner's model as model:=FILE: another scanner's may"
            f" drive its resonance. To use the simulated scanner's on purpose, give {default}"
        )
    return model or default


def scanner_of(scanner: str, plant: str) -> tuple[str, list[str | Parameters], Parameters]:
    """Return the scanner's node, its parameters (none if it runs already) and the source's."""
    if scanner == "external":
        return "scanner_driver", [], {}
    if scanner == "sim":
        own = {"plant_file": text(plant)}
        return "piezoscanner_sim", [str(CONFIG / "piezoscanner_sim.yaml"), own], {}
    from afm_scan_ros.cli.scanner import driver_and_file  # noqa: PLC0415 - takes seconds
    from afm_scan_ros.drivers import load_settings  # noqa: PLC0415 - as above

    driver, file = driver_and_file(scanner)
    settings = load_settings(driver, file).settings
    source = {
        "sampling_instant": settings.sampling_instant,
        "trigger_offset_s": settings.trigger_offset,
    }
    return "scanner_driver", [{"driver": driver, "settings_file": text(str(file))}], source


def nodes(context: LaunchContext) -> list[Node]:
    """Return the nodes for the arguments given."""
    given = {a.name: LaunchConfiguration(a.name).perform(context) for a in ARGUMENTS}
    model_file = text(model_of(given["model"], given["scanner"]))
    model = {"model_file": model_file, "inverses": given["inverses"].split(",")}
    imagers = [] if given["sample"] == "none" else ["scan_imager"]
    watches = ["residual_monitor"] if given["watch"] == "true" else []
    online = {name: given[name] == "true" for name in ("line_feedback", "adapt")}
    waits = any(online.values())
    scanner, moved, instant = scanner_of(given["scanner"], given["plant"])
    consumers = ["inversion_compensator", scanner, "tracking_monitor", "scan_recorder"]
    true = ["true_displacement"] if given["scanner"] == "sim" else []
    recorded = ["desired_displacement", "drive_voltage", "achieved_displacement", *true]
    time_scale = float(given["time_scale"])
    pace = {"time_scale": time_scale, "real_time": time_scale > 0.0}
    source = instant | {
        "required_nodes": consumers + imagers + watches,
        "min_subscriptions": 3 + len(imagers),
    }
    parameters = {
        "scan_recorder": [{"bag": text(given["bag"]), "topics": recorded}],
        "tracking_monitor": [{"min_subscriptions": 1}],
        "inversion_compensator": [
            str(CONFIG / "inversion_compensator.yaml"),
            model | {"min_subscriptions": 3 + len(watches)} | online,
        ],
        "trajectory_generator": [given["spec"], model | source],
    }
    if moved:
        parameters[scanner] = [*moved, {"min_subscriptions": 2 + len(imagers + watches) + waits}]
    if imagers:
        file = text("" if given["sample"] == "grating" else given["sample"])
        parameters["scan_imager"] = [str(CONFIG / "scan_imager.yaml"), {"sample_file": file}]
    if watches:
        watched = {"model_file": model["model_file"], "min_subscriptions": 1}
        watched["adapt"] = online["adapt"]
        parameters["residual_monitor"] = [str(CONFIG / "residual_monitor.yaml"), watched]
    return [
        Node(
            package="afm_scan_ros",
            executable=name,
            namespace=given["namespace"],
            parameters=[*values, pace],
            output="screen",
            on_exit=judge,
        )
        for name, values in parameters.items()
    ]


def generate_launch_description() -> LaunchDescription:
    """Return what ``ros2 launch`` runs."""
    return LaunchDescription([*ARGUMENTS, OpaqueFunction(function=nodes)])
