"""A creep record → the springs and dampers in series behind it, and how far each is known."""
