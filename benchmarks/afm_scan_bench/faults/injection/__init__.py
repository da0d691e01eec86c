"""Faults, each injected into running nodes or into files, and what they cost."""
