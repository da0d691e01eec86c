"""What is timed, by turns, and how its ratios are stated."""
