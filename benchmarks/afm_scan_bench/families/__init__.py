"""Scanners with five families of hysteresis, none of them computed as the product does."""
