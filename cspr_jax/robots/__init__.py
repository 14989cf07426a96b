"""Robots: what they are, their statics, tensions and contacts at one state, and bounds of these over blocks."""
