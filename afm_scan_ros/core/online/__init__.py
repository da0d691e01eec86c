"""Correction of the reference from measured errors: from scan to scan and from line to line."""

TIME_CONSTANT = 1.0
"""Default memory of the adaptation, s; here, so that a node knows it without the estimator."""
