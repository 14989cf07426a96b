"""Tensions of redundant cables: those of least norm, rules that choose among them, and linear programs."""
