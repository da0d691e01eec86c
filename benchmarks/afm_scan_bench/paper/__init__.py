"""The paper's tables and figures, made anew: each is a module whose ``section`` makes it."""
