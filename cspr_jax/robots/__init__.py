"""Robots: geometry, mass, the balance of forces and wrenches, rest, symmetries, contacts of cables."""
