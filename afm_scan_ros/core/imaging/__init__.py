"""Images from paths: what was read where, where it is drawn, and what a picture then tells."""
