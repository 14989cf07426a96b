"""The process: XLA's settings, compiled code, what is being done, and how it is shown."""
