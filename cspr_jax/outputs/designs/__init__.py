"""Designs as JSON, as a table for people, and as robot files."""
