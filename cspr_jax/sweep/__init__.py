"""Sweeps: what a file asks, which processes compute its tiles, and how a stopped run resumes."""
