"""Minima: golden sections, constrained and evolutionary searches, and minima by halving blocks."""
