"""Correction of the reference from measured errors: from scan to scan and from line to line."""
