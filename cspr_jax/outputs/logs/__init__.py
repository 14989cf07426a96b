"""Recorded logs beside plans: curves of a plan over time, and the comparison as lines, as a table and as JSON."""
