"""Robots, orientations, limits and problems that kernels take, built from checked files."""
