"""Robots: models, statics, tensions and contacts in one state, and bounds of these over blocks of time."""
