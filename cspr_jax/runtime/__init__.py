"""Processes: XLA's settings, compiled code, workers, what is being done, and how it is shown."""
