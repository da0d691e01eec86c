"""Scanners and protocols drawn at random, and what identification makes of them."""
