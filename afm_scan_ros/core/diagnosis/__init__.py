"""A residual traced to the effect that the model lacks."""
