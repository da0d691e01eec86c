"""Linear models of many inputs and outputs, with what acts in their feedback, from spectra."""
