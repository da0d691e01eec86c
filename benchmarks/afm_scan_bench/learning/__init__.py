"""What is learned from the measured error: from line to line, and from scan to scan."""
