"""Statistics of a residual: correlation, coherence, dependence on the motion, repetition."""
