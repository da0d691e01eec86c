"""How fast the package is, as ratios."""
