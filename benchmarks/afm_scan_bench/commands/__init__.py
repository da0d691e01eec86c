"""Commands that this package adds to afm-scan."""
