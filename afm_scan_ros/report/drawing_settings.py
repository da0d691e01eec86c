"""How much of a recording a page of a report draws."""

from attrs import frozen

from afm_scan_ros.core.settings import setting


@frozen
class DrawingSettings:
    """Sizes of what a page draws, by which it has at most 3 MB whatever the recording."""

    stretches: int = setting(
        3000,
        "1",
        "stretches of a long curve, of each of which the lowest and the highest sample are drawn",
        "a screen has some 3000 columns, and a curve then takes 64 kB",
    )
    pixels: int = setting(
        180_000,
        "pixels",
        "of all images of a page together",
        "they take 1 MB",
    )
    side: int = setting(
        256, "pixels", "along a side of an image, at most", "an image is some 400 pixels wide"
    )
    error_pixels: int = setting(
        128,
        "pixels",
        "in a line of the image of an error, at most",
        "the errors of both axes on trace and retrace take 700 kB",
    )
    row: int = setting(
        200, "pixels", "height of a row of panels", "answer and figure fit into 800 pixels"
    )


DRAWING = DrawingSettings()
