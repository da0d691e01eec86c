"""Learning: a scan is repeated, and a correction of its reference learned from its errors."""

COMMANDS = {"learn": "Repeat a scan and learn its reference from the measured errors."}
