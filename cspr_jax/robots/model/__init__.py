"""Models of robots: points, mass, limits, shapes and pulleys, and the state of an effector."""
