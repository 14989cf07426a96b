"""Processes: XLA's settings, compiled code, workers, and the progress that a terminal shows."""
