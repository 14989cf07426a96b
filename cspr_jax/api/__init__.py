"""The package from Python, in the axes of the robot file: all that the command line does, and single motions."""
