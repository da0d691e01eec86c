"""How often a stated interval holds what it is stated of, part by part."""
