"""Base classes of the maps of a sweep; each kind of map is in the folder of its subject."""
