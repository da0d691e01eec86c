"""Benchmarks of learning from scan to scan, of line feedback, and of adaptation."""
