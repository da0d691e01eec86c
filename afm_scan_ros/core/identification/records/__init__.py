"""What a calibration record holds, and what may be wrong with it."""
