"""Finds the effects that a model lacks, from the residuals of records."""
