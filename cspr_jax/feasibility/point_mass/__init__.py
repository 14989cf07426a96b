"""Feasibility of motions of a point mass: slacks, bounds, certificate, margins."""
