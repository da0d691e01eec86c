"""Images from scan paths."""
