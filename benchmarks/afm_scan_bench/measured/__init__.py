"""Studies of other people's recordings."""
