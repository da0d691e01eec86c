"""The other process of the tests: what it does is its first argument."""

import signal
import sys
import threading
import time

import numpy as np

from afm_scan_ros import ros

KEEP_ALL = ros.QoSProfile(history=ros.HistoryPolicy.KEEP_ALL)
LATCHED = ros.QoSProfile(depth=3, durability=ros.DurabilityPolicy.TRANSIENT_LOCAL)
SAMPLES = 1000


def ramp(index: int) -> ros.Message:
    x = np.arange(index * SAMPLES, (index + 1) * SAMPLES, dtype=float)
    return ros.DisplacementBlock(scan_id="ramp", first_sample=index * SAMPLES, x=x, y=-x)


def publish(node: ros.Node, count: str) -> None:
    """Publish so many blocks, and stay until a line arrives on the standard input."""
    publisher = node.create_publisher(ros.DisplacementBlock, "blocks", KEEP_ALL)
    while publisher.get_subscription_count() == 0:
        time.sleep(0.01)
    for index in range(int(count)):
        publisher.publish(ramp(index))
    sys.stdin.readline()


def advertise(node: ros.Node) -> None:
    """Have a publisher until a line arrives on the standard input."""
    node.create_publisher(ros.DisplacementBlock, "blocks", KEEP_ALL)
    sys.stdin.readline()


def latch(node: ros.Node, count: str) -> None:
    publisher = node.create_publisher(ros.NodeState, "state", LATCHED)
    for index in range(int(count)):
        publisher.publish(ros.NodeState(state=ros.NodeState.RUNNING, next_sample=index))
    sys.stdout.write("latched\n")
    sys.stdout.flush()
    time.sleep(60)


def read(node: ros.Node) -> None:
    node.create_subscription(ros.DisplacementBlock, "blocks", lambda _: None, KEEP_ALL)
    spin(node)


def flood(node: ros.Node) -> None:
    """Publish until it has blocked for a second; say how often another thread ran meanwhile."""
    turns = [0]

    def count() -> None:
        while True:
            turns[0] += 1
            time.sleep(0.01)

    threading.Thread(target=count, daemon=True).start()
    publisher = node.create_publisher(ros.DisplacementBlock, "blocks", KEEP_ALL)
    while publisher.get_subscription_count() == 0:
        time.sleep(0.01)
    sys.stdout.write("begins\n")
    sys.stdout.flush()
    before, waited = 0, 0.0
    while waited < 1.0:
        before, began = turns[0], time.monotonic()
        publisher.publish(ramp(0))
        waited = time.monotonic() - began
    sys.stdout.write(f"{turns[0] - before}\n")


def outrun(node: ros.Node, count: str) -> None:
    """Publish so many blocks to a reader that was stopped; say whether it is still a reader."""
    publisher = node.create_publisher(ros.DisplacementBlock, "blocks", KEEP_ALL)
    while publisher.get_subscription_count() == 0:
        time.sleep(0.01)
    sys.stdout.write("begins\n")
    sys.stdout.flush()
    sys.stdin.readline()
    for index in range(int(count)):
        publisher.publish(ramp(index))
    sys.stdout.write(f"{publisher.get_subscription_count()}\n")
    sys.stdout.flush()


def serve(node: ros.Node) -> None:
    def stop(_: ros.Message, response: ros.Message) -> ros.Message:
        response.success, response.message = True, "ramped down"
        return response

    node.create_service(ros.Trigger, "stop", stop)
    spin(node)


def spin(node: ros.Node) -> None:
    executor = ros.SingleThreadedExecutor()
    executor.add_node(node)
    executor.spin()


if __name__ == "__main__":
    signal.signal(signal.SIGTERM, lambda *_: sys.exit())  # leaving the domain as it ends
    if sys.argv[1] == "outrun":
        ros.use_node_settings()
    ros.init(args=[], signal_handler_options=ros.SignalHandlerOptions.NO)
    task, *arguments = sys.argv[1:]
    tasks = (publish, advertise, latch, read, flood, outrun, serve)
    {known.__name__: known for known in tasks}[task](ros.Node("peer"), *arguments)
    ros.shutdown()
