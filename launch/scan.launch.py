"""One scan with the simulated scanner: ros2 launch afm_scan_ros scan.launch.py bag:=scan1."""

from datetime import datetime
from pathlib import Path

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
        "model", default_value=str(CONFIG / "model.yaml"), description="What is inverted"
    ),
    DeclareLaunchArgument(
        "plant", default_value=str(CONFIG / "plant.yaml"), description="What is simulated"
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


def text(value: str) -> ParameterValue:
    """Keep a parameter text, where launch would read a name like 2026 as a number."""
    return ParameterValue(value, value_type=str)


def judge(event: ProcessExited, context: LaunchContext) -> None:
    """End the launch with status 1 at the first node that fails; after a good scan all end."""
    if event.returncode and not context.is_shutdown:
        raise RuntimeError(f"{event.process_name} ended with status {event.returncode}")


def nodes(context: LaunchContext) -> list[Node]:
    """Return the nodes for the arguments given."""
    given = {a.name: LaunchConfiguration(a.name).perform(context) for a in ARGUMENTS}
    model = {"model_file": text(given["model"]), "inverses": given["inverses"].split(",")}
    imagers = [] if given["sample"] == "none" else ["scan_imager"]
    watches = ["residual_monitor"] if given["watch"] == "true" else []
    consumers = ["inversion_compensator", "piezoscanner_sim", "tracking_monitor", "scan_recorder"]
    source = {
        "required_nodes": consumers + imagers + watches,
        "min_subscriptions": 3 + len(imagers),
        "time_scale": float(given["time_scale"]),
    }
    parameters = {
        "scan_recorder": [str(CONFIG / "scan_recorder.yaml"), {"bag": text(given["bag"])}],
        "tracking_monitor": [{"min_subscriptions": 1}],
        "piezoscanner_sim": [
            str(CONFIG / "piezoscanner_sim.yaml"),
            {"plant_file": text(given["plant"]), "min_subscriptions": 2 + len(imagers + watches)},
        ],
        "inversion_compensator": [
            str(CONFIG / "inversion_compensator.yaml"),
            model | {"min_subscriptions": 2 + len(watches)},
        ],
        "trajectory_generator": [given["spec"], model | source],
    }
    if imagers:
        file = text("" if given["sample"] == "grating" else given["sample"])
        parameters["scan_imager"] = [str(CONFIG / "scan_imager.yaml"), {"sample_file": file}]
    if watches:
        watched = {"model_file": model["model_file"], "min_subscriptions": 1}
        parameters["residual_monitor"] = [str(CONFIG / "residual_monitor.yaml"), watched]
    return [
        Node(
            package="afm_scan_ros",
            executable=name,
            namespace=given["namespace"],
            parameters=[*values, {"real_time": float(given["time_scale"]) > 0.0}],
            output="screen",
            on_exit=judge,
        )
        for name, values in parameters.items()
    ]


def generate_launch_description() -> LaunchDescription:
    """Return what ``ros2 launch`` runs."""
    return LaunchDescription([*ARGUMENTS, OpaqueFunction(function=nodes)])
