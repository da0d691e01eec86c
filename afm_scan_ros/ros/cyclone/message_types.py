"""Message classes made from ``.msg`` definitions, alike in use to those that rosidl generates."""

from functools import cache
from typing import Any, TypeAlias

import attrs
import numpy as np
from numpy.typing import ArrayLike, NDArray
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from afm_scan_ros.files import PACKAGE, own_types
from afm_scan_ros.ros.common import Message

Description: TypeAlias = tuple[Nodetype, Any]  # of a field, as rosbags parses it

_EMPTY = "uint8 structure_needs_at_least_one_member\n"
_MANAGED = "lifecycle_msgs/srv"

# As ROS's packages and rosidl define them; rosbags' typestore holds the types of topics only.
_SERVICE_PARTS = {
    "std_srvs/srv/Trigger_Request": _EMPTY,
    "std_srvs/srv/Trigger_Response": "bool success\nstring message\n",
    f"{_MANAGED}/ChangeState_Request": "lifecycle_msgs/Transition transition\n",
    f"{_MANAGED}/ChangeState_Response": "bool success\n",
    f"{_MANAGED}/GetState_Request": _EMPTY,
    f"{_MANAGED}/GetState_Response": "lifecycle_msgs/State current_state\n",
    f"{_MANAGED}/GetAvailableStates_Request": _EMPTY,
    f"{_MANAGED}/GetAvailableStates_Response": "lifecycle_msgs/State[] available_states\n",
    f"{_MANAGED}/GetAvailableTransitions_Request": _EMPTY,
    f"{_MANAGED}/GetAvailableTransitions_Response": (
        "lifecycle_msgs/TransitionDescription[] available_transitions\n"
    ),
}

_NUMPY = {"bool": "bool_", "byte": "uint8", "char": "uint8"}
_BUILTIN = {"bool": bool, "float32": float, "float64": float, "string": str}


def _service_parts() -> dict[str, Any]:
    # The parser files what it reads under .../msg/..., a service's parts too.
    return {
        name: next(iter(get_types_from_msg(text, name).values()))
        for name, text in _SERVICE_PARTS.items()
    }


TYPESTORE = get_typestore(Stores.ROS2_JAZZY)
TYPESTORE.register({**own_types(), **_service_parts()})


@cache
def message_class(name: str) -> type[Message]:
    """Class of the messages of type ``package/msg/Name``.

    As in rclpy its instances start out with defaults, take keywords, and check what is assigned.
    A sequence of numbers is held as a numpy array: an ``array.array`` or an array of the same
    type is taken as it is, without looking at each element.
    """
    constants, fields = TYPESTORE.fielddefs[name]
    made = attrs.make_class(
        name.rsplit("/", 1)[1],
        {field: _attribute(described) for field, described in fields},
        class_body={"__msgtype__": name, **{key: value for key, _, value in constants}},
        slots=True,
        on_setattr=[attrs.setters.convert, attrs.setters.validate],
    )
    TYPESTORE.types[name] = made  # so that deserialising makes these, nested ones too
    return made


def _attribute(described: Description) -> object:
    node, kind = described
    if node == Nodetype.NAME:
        nested = message_class(kind)
        return attrs.field(factory=nested, validator=attrs.validators.instance_of(nested))
    if node == Nodetype.BASE:
        builtin = _BUILTIN.get(kind[0], int)
        return attrs.field(default=builtin(), validator=attrs.validators.instance_of(builtin))
    (element, element_kind), length = kind
    if element == Nodetype.NAME or element_kind[0] == "string":
        return attrs.field(factory=list, converter=list)
    dtype = np.dtype(_NUMPY.get(element_kind[0], element_kind[0]))
    size = length if node == Nodetype.ARRAY else 0
    return attrs.field(
        factory=lambda: np.zeros(size, dtype),
        converter=lambda value: _array(value, dtype),
        eq=attrs.cmp_using(eq=np.array_equal),
    )


def _array(value: ArrayLike, dtype: np.dtype[Any]) -> NDArray[Any]:
    # CDR puts doubles four bytes past an eightfold address; compiled loops want them aligned.
    array = np.asarray(value, dtype)
    return array if array.flags.carray else array.copy()


def serialize_message(message: Message) -> bytes:
    """CDR of a message, with its four-byte header, as rclpy's ``serialize_message``."""
    return bytes(TYPESTORE.serialize_cdr(message, message.__msgtype__))


def deserialize_message(serialized: bytes, message_type: type[Message]) -> Message:
    """Message of a CDR text, as rclpy's ``deserialize_message``."""
    return TYPESTORE.deserialize_cdr(serialized, message_type.__msgtype__)


def type_hash(message_type: type[Message]) -> str:
    """Hash by which ROS 2 tells versions of a type apart, ``RIHS01_`` and 64 hex digits."""
    return TYPESTORE.hash_rihs01(message_type.__msgtype__)


DiagnosticArray = message_class("diagnostic_msgs/msg/DiagnosticArray")
DiagnosticStatus = message_class("diagnostic_msgs/msg/DiagnosticStatus")
DisplacementBlock = message_class(f"{PACKAGE}/msg/DisplacementBlock")
Header = message_class("std_msgs/msg/Header")
Image = message_class("sensor_msgs/msg/Image")
KeyValue = message_class("diagnostic_msgs/msg/KeyValue")
MonitorSample = message_class(f"{PACKAGE}/msg/MonitorSample")
NodeState = message_class(f"{PACKAGE}/msg/NodeState")
ScanInfo = message_class(f"{PACKAGE}/msg/ScanInfo")
TrackingError = message_class(f"{PACKAGE}/msg/TrackingError")
VoltageBlock = message_class(f"{PACKAGE}/msg/VoltageBlock")


class ServiceType:
    """A service; each is a class of its own."""

    Request: type[Message]
    Response: type[Message]


def service_class(name: str) -> type[ServiceType]:
    """Class of the service ``package/srv/Name``, with the classes of its two messages."""
    parts = {part: message_class(f"{name}_{part}") for part in ("Request", "Response")}
    return type(name.rsplit("/", 1)[1], (ServiceType,), parts)


Trigger = service_class("std_srvs/srv/Trigger")
