"""Sweeps: their definition in a file, executors of their tiles, and runs that can be resumed."""
