"""Faults injected into nodes, bags, files and links."""
