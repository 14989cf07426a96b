"""Feasibility of motions of a platform: slacks, samples, checks, cables that cross."""
