"""The fast steering mirror, as measured: its fits, rivals and figure."""
