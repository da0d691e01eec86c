"""Loops seen in images of gratings: hysteresis, creep and lag fitted together."""
