"""Images of scanning-probe microscopes: files of several programs, read and written."""
