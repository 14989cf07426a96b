"""Bounds over a block of time: of states, pulleys, contacts, and of tensions that balance a motion."""
