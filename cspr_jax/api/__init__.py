"""The package from Python, in the axes of the robot file: what the command line calls, and one motion at a time."""
