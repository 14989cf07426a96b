"""Faults of disk, process and file, and what must survive them."""
