"""Pictures of motions over time and in space."""
