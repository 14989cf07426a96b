"""Processes: XLA's settings, compiled code, worker processes, stages of the work and their display."""
