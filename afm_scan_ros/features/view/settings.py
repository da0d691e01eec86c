"""How a view keeps up with a scan, and what it leaves out where it cannot."""

from attrs import frozen

from afm_scan_ros.core.types import setting


@frozen
class ViewSettings:
    """Times and amounts of a live view, none of which a scan waits for but ``closing``."""

    queue: float = setting(
        64e6,
        "byte",
        "Blocks that wait for the viewer's process at most; the oldest go first",
        "13 s of three streams at 100 kHz, four times as long as the viewer takes to start",
    )
    queued_news: int = setting(
        10_000, "1", "News and figures of lines that wait at most", "100 lines/s for 100 s"
    )
    refresh: float = setting(
        0.05, "s", "Time between two updates of the viewer", "a tenth of the 0.5 s aimed at"
    )
    image_interval: float = setting(
        0.25, "s", "Least time between two images, and two tables of states", "as of scan_imager"
    )
    pixels: int = setting(256, "1", "Pixels in a line of the image of errors", "as of scan_imager")
    closing: float = setting(
        3.0,
        "s",
        "Longest wait of a scan, when it is over, for a sign that the viewer shows the rest",
        "sixty updates; one that is stopped is left behind",
    )
    finishing: float = setting(
        60.0,
        "s",
        "Longest wait, when it is over, for a viewer that goes on",
        "nothing moves any more; on two cores with ten busy processes it takes half of that",
    )
    giving_up: float = setting(
        2.0,
        "s",
        "Longest try to reach a viewer that is gone",
        "twice closing; data are dropped then",
    )
    opening: float = setting(
        20.0, "s", "Longest wait for the viewer to open", "ten times what it takes on two cores"
    )
    port: int = setting(
        9886,
        "1",
        "First of three ports on the loopback",
        "ten above Rerun's own, so that both can be open",
    )
    niceness: int = setting(
        5,
        "1",
        "Niceness of the viewer and of what feeds it, and of their sessions",
        "a third of a scan's share of a core; at 10 a busy machine leaves nothing for them",
    )
