"""Diagnosis of coupled axes: which effects explain what a model of them leaves."""
