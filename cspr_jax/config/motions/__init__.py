"""Motions that users bring, read from files of text and XML."""
