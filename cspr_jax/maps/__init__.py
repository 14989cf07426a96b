"""Base classes of the maps of a sweep; the kinds of map are in the folders of their subjects."""
