"""Robots and obstacles in pictures."""
