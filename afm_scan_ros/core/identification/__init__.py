"""From records of a driven scanner to the model of it, with a report of the fit."""
