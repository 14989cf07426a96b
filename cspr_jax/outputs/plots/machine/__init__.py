"""Pictures of what drives a robot."""
