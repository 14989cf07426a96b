"""Base classes of the maps of a sweep; the kinds of map are in the rooms of their subjects."""
