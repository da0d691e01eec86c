"""Scan, trace the residual, extend the model, scan again: until nothing more is found."""
