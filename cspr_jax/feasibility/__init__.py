"""Verdict and margin of one trajectory."""
