"""What a residual looks like: coherence, correlation, dependence, and place in the scan."""
