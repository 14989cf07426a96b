"""Processes: XLA's settings, compiled code, workers, stages of the work, and how they are shown."""
