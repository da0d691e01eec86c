"""Waves, chirps and steps of a drive → the frequency response, and the model behind it."""
