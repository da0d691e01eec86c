"""Images from scan paths, and figures of merit of a grating's image."""
