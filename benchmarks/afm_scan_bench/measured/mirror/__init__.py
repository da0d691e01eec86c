"""The measured fast steering mirror: fits, competing models and figure."""
