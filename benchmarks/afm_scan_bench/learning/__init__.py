"""Figures of learning from repeated scans, from lines, and of adaptation."""
