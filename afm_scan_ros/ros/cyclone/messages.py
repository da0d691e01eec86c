"""The message classes that the package's nodes use."""

from afm_scan_ros.files.share import PACKAGE
from afm_scan_ros.ros.cyclone.message_types import message_class

DisplacementBlock = message_class(f"{PACKAGE}/msg/DisplacementBlock")
Header = message_class("std_msgs/msg/Header")
Image = message_class("sensor_msgs/msg/Image")
NodeState = message_class(f"{PACKAGE}/msg/NodeState")
ScanInfo = message_class(f"{PACKAGE}/msg/ScanInfo")
TrackingError = message_class(f"{PACKAGE}/msg/TrackingError")
VoltageBlock = message_class(f"{PACKAGE}/msg/VoltageBlock")


class Trigger:
    """``std_srvs/srv/Trigger``."""

    Request = message_class("std_srvs/srv/Trigger_Request")
    Response = message_class("std_srvs/srv/Trigger_Response")
