"""How often a residual is traced to the right effect."""
