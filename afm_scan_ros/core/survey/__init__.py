"""Survey of many recordings: what each tells of a scanner, and when a scanner changed."""
