"""Kinds of messages from a scan to the viewer's process, and what that process shows."""

SCAN, BLOCK, LINE, DOING, SAY, ENDED = "scan", "block", "line", "doing", "say", "ended"
LEFT_OUT = "left_out"
PIPELINE, NODES = "pipeline", "nodes"
"""What is shown: what comes over the link, or what nodes publish until the link closes."""
MISSING = "left out of this view, which was behind, not of the bag"
