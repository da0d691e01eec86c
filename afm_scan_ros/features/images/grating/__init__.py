"""Images of a grating of known pitch → where the scanner was at every pixel."""
