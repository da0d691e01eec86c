"""The measured micromanipulator: identification, diagnosis and figures."""
