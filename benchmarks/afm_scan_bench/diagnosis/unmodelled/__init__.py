"""Scanners with unmodelled effects: drawn, diagnosed, evaluated and tabulated."""
