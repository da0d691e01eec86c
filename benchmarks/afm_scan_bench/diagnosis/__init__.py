"""How often the diagnosis identifies the right effect."""
