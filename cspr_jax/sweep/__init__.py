"""Sweeps: the definition in a file, executors of its tiles, and runs that go on after they were stopped."""
