"""Files of a run: their safe writing, their content, and their checks."""
