"""Images: a scanner identified from those of a grating, and the formats of other programs."""

COMMANDS = {
    "grating": "Identify a scanner without a sensor from images of a grating.",
    "export": "Write images and signals of a bag for other programs.",
}
