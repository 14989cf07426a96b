"""Outputs that people and other programs read: reports, motion files, lists, models for MuJoCo, pictures."""
