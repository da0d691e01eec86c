"""Diagnosis of many recordings, and of the changes of their instruments."""

COMMANDS = {"survey": "Diagnose many recordings, and say which instruments changed and when."}
