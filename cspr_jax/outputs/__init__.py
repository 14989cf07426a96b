"""Outputs that people and other programs read: reports, motion files, lists, pictures."""
