"""Searches for minima: by golden sections, with constraints, by evolution, and by halving blocks."""
