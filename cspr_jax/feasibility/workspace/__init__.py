"""Workspaces: whether the cables of a robot can hold its effector at a pose, with a margin."""
