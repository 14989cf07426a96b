"""Searches: numbers of arcs, oscillations, beta-hat and orientations that make a motion feasible."""
