"""Tensions of redundant cables: of least norm or by other rules, and linear programs to compare with."""
