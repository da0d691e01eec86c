"""What else the machine does while a bench measures on it."""

import os


def load() -> str:
    """Describe the machine's work, since it decides what can be kept up with."""
    return f"{os.cpu_count()} cores, load {os.getloadavg()[1]:.1f} in the last five minutes"
