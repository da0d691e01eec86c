"""Scanners with an effect that nobody declared: drawn, traced, judged, and put into a table."""
