"""Reports on what drives a robot."""
