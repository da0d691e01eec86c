"""Closed loop: scan, diagnose the residual, extend the model, and scan again."""
