"""What may be wrong with a scanner: one mechanism a file, from its physics."""
