"""The package's figures of accuracy, each printed by ``afm-scan bench NAME``."""
