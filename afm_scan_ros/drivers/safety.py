"""Times by which a scan watches what owns or feeds a drive, and ends."""

from attrs import frozen

from afm_scan_ros.core.types import setting


@frozen
class SafetySettings:
    """Times that no parameter of a node states, all in wall time."""

    heartbeat: float = setting(
        0.05, "s", "Time between two states of a node", "six in the 0.3 s that decide on a failure"
    )
    watch: float = setting(
        0.02, "s", "Time between two looks at the other nodes", "a fifteenth of those 0.3 s"
    )
    idle: float = setting(
        0.01,
        "s",
        "Longest wait for a message, and longest work on messages, before everything is looked at",
        "half the time between two looks",
    )
    doubt: float = setting(
        0.3,
        "s",
        "Silence of a node during which a source begins nothing and sends nothing",
        "the longest standstill: a reader that is stopped would block the source",
    )
    inattention: float = setting(
        0.2,
        "s",
        "Work without listening after which a node cannot tell who has been silent",
        "four heartbeats may then wait unread",
    )
    silence_at_rest: float = setting(
        5.0,
        "s",
        "Silence of the source after which a node no longer waits for its scan",
        "more than Fast DDS's heartbeat of 3 s, which repeats a lost message; nothing moves yet",
    )
    naming: float = setting(
        0.2,
        "s",
        "Longest time in which the name of a node follows on its publisher",
        "rmw announces names on a topic of its own",
    )
    discovery: float = setting(
        7.0,
        "s",
        "Longest wait for readers of a last state, or for the announcement of blocks that came",
        "DDS announces a participant every 3 s; twice that, since the first may be lost",
    )
    last_word: float = setting(
        0.3, "s", "Time for which a node stays after its last state", "six more of it are sent"
    )
    leaving: int = setting(
        5,
        "s",
        "Time in which a node leaves ROS, or its process ends without",
        "usually 0.1 s; Fast DDS may wait without end (`nodes/ending.py`)",
    )
    ahead: float = setting(
        0.05,
        "s",
        "Longest drive given to the driver at once",
        "it is output even if the process that gave it is gone; a tenth of the 0.5 s to rest",
    )
    held: float = setting(
        0.3,
        "s",
        "Silence, or lack of drive, until the outputs of a real scanner ramp down, without ROS",
        "0.5 s to rest, less the ramp and the process's turn (`DriverTimeouts`)",
    )
    simulated: float = setting(
        3.0,
        "s",
        "Silence until the process of a simulated scanner ends, without ROS",
        "it tells a process that hangs; nothing moves",
    )
    opening: float = setting(
        60.0,
        "s",
        "Longest time in which a driver opens or starts, without ROS",
        "hardware homes and calibrates meanwhile",
    )
    sign_of_life: float = setting(
        0.05,
        "s",
        "Time between two signs of life to the driver's process",
        "six in the 0.3 s until it ramps down",
    )
    rest: float = setting(
        3.0,
        "s",
        "Longest time, beside the ramp itself, for the outputs to be at rest",
        "a late call of the driver may still return, and is followed by the ramp; then its process"
        " is killed, which holds the outputs, but frees the device for its watchdog",
    )
