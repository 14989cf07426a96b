"""Harmonic ellipses."""
