"""One axis from records of any kinds: hysteresis, creep and lag fitted together."""
