"""Trajectory families: a folder each, with all that is known about it. None imports another."""
