"""Tensions of redundant cables: the least ones, rules that choose among them, and linear programs."""
