"""Motions and searches of trajectory families from Python."""
