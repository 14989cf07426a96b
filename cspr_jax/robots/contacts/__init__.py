"""Contacts: distances of cables, platforms and obstacles, at poses and between moving bodies."""
