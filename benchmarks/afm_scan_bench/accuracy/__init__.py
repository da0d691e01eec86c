"""How exactly the scanner follows and the model is identified."""
