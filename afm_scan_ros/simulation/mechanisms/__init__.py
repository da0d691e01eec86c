"""Mechanisms that a simulated scanner may have besides its own parts, by physics family."""
