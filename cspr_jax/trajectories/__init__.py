"""Trajectory families, one file each."""
