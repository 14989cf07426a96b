"""Formats and rates of set points; without jax: the command line uses them before slow work."""

# Content of a file of set points, by its ending.
SETPOINT_FORMATS = {
    ".csv": "a header line and numbers",
    ".yaml": "a JointTrajectory of ROS 2",
    ".json": "a JointTrajectory of ROS 2",
    ".txt": "counts of the encoders, one row a cycle",
}
USUAL_RATE = 1000.0  # Hz
LARGEST_RATE = 1e6  # Hz
# Names of joints of robots with winches, and of others.
MOTOR, CABLE = "winch", "cable"
NANO = 1_000_000_000  # nanoseconds of a second
