"""Drives that make a scanner show what it does, and what each axis is driven with."""
