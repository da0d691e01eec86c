"""Corrections of the desired displacement that are learned from the measured error."""
